"""
Out to other programs, and back: frequency responses as CSV, UFF, MAT, NetCDF and NPZ, and as objects of python-control, xarray,
pandas and SDyPy; plants as MAT and NPZ; responses in time as CSV and NPZ; travels from CSV.
"""

from cutvib_ss.files import staged
from cutvib_ss.interchange.conversions import (
    from_control,
    from_dataframe,
    from_sdypy,
    from_xarray,
    to_control,
    to_sdypy,
)
from cutvib_ss.interchange.frf_files import frf_csv, read_frf, write_frf
from cutvib_ss.interchange.plant_files import read_plant, write_plant
from cutvib_ss.interchange.time_files import read_time_response, write_time_response
from cutvib_ss.interchange.travel_files import read_travel

__all__ = [
    "frf_csv",
    "from_control",
    "from_dataframe",
    "from_sdypy",
    "from_xarray",
    "read_frf",
    "read_plant",
    "read_time_response",
    "read_travel",
    "staged",
    "to_control",
    "to_sdypy",
    "write_frf",
    "write_plant",
    "write_time_response",
]
