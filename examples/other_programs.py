"""
Out to other programs: plants for MATLAB, frequency responses for modal analysis programs, python-control, xarray and pandas.

    python examples/other_programs.py
"""

import numpy as np

import cutvib_ss as cv
from cutvib_ss.interchange import read_plant, to_control, to_sdypy

machine = cv.published_machine()

# One call to a file that MATLAB's ss takes: one plant, or a family over positions.
cv.write_plant(machine.plant(0.5), "plant.mat", positions=0.5)
cv.write_plant(cv.schedule(machine, np.linspace(0.05, 0.95, 19)), "plants.mat")
print(f"plant.mat: {read_plant('plant.mat').nstates} states; plants.mat: {len(read_plant('plants.mat'))} plants")

# A hammer on the rail at a quarter of its length, with a rotation among the responses.
frf = cv.frequency_response(
    machine,
    [1 / 3, 1 / 2],
    np.arange(10.0, 300.0, 0.5),
    inputs=["force", "rail@0.25"],
    outputs=["tool_x", "joint2", "base_x"],
)
print(frf)
for suffix in (".uff", ".mat", ".npz"):
    cv.write_frf(frf, f"frf{suffix}")
    assert cv.read_frf(f"frf{suffix}").units == frf.units

# Objects of other libraries.
print(to_control(frf, position=0.5).output_labels)
print({name: np.shape(value) for name, value in to_sdypy(frf, position=0.5).items()})
try:
    print(frf.sel(input="force").to_dataframe().head(3))
    print(frf.to_xarray()["response"].sizes)
except cv.CutvibError as error:
    print(error)
