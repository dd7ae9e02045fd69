"""The responses behind Figs. 15 to 20, as far as printed values allow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.absorber import check_absorber
from cutvib_ss.identification.held_head import held_response
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.rail import mode_shapes
from cutvib_ss.parameters import PAPER_POSITIONS, table_1, table_3, table_7
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import AbsorberCheck, FloatArray, FrequencyResponse

FIG_16 = ("CC", "FC", "CR and FR")
"""Positions of Fig. 16 and Table 4; the model knows no difference between CR and FR, along the machine."""
FIG_20 = ("CC", "FR")
"""Central and lateral position of Fig. 20."""
_MEASURED_BAND = np.arange(150.0, 300.25, 0.25)
_SEEN = 1e-9
"""A modal coordinate below this part of the largest is not excited: its node is under the head."""


@dataclass(frozen=True)
class PaperCurves:
    """
    What the figures show.

    Parameters
    ----------
    held : dict of str to FrequencyResponse
        Fig. 15: accelerances XX and ZX with the base held, of Tables 1 and 3.
    positions : FrequencyResponse
        Fig. 16: accelerances XX and ZX at CC, FC, and CR or FR, in this order.
    shapes : ndarray, shape (point, mode)
        Fig. 17: the rail's first four modes, at 201 points from end to end [kg^-0.5].
    modal : dict of str to FrequencyResponse
        Fig. 18: receptances of the modal coordinates that are excited at FC and at CC.
    base : FrequencyResponse
        Fig. 19: accelerance of the base, CC, to 600 Hz.
    absorber : AbsorberCheck
        Fig. 20: accelerance XX without and with Table 7's absorber, in central and lateral position.
    """

    held: dict[str, FrequencyResponse]
    positions: FrequencyResponse
    shapes: FloatArray
    modal: dict[str, FrequencyResponse]
    base: FrequencyResponse
    absorber: AbsorberCheck


def paper_curves(machine: Machine | None = None) -> PaperCurves:
    """
    Compute what Figs. 15 to 20 show; measured curves are not among it, for the paper prints no numbers of them.

    Parameters
    ----------
    machine : Machine, optional
        The machine; the published one by default.

    Returns
    -------
    PaperCurves
        Responses, mode shapes, the absorber's effect.
    """
    model = published_machine() if machine is None else machine
    held = {
        name: held_response(head, _MEASURED_BAND) for name, head in (("Table 1", table_1()), ("Table 3", table_3()))
    }
    where = np.array([PAPER_POSITIONS[name.split()[0]] for name in FIG_16])
    return PaperCurves(
        held=held,
        positions=frequency_response(model, where, _MEASURED_BAND, outputs=["tool_x", "tool_z"]),
        shapes=mode_shapes(model.rail.parameters, np.linspace(0.0, 1.0, 201))[:, :4],
        modal={name: excited(model, PAPER_POSITIONS[name]) for name in ("FC", "CC")},
        base=frequency_response(model, PAPER_POSITIONS["CC"], np.arange(1.0, 600.25, 0.25), outputs="base_x"),
        absorber=check_absorber(model, table_7(), [PAPER_POSITIONS[name] for name in FIG_20]),
    )


def excited(machine: Machine, position: float) -> FrequencyResponse:
    """Receptances of the first four modal coordinates, those left out whose node is under the head."""
    names = [f"eta{r}" for r in range(1, 5)]
    frf = frequency_response(machine, position, np.arange(1.0, 300.25, 0.25), form="receptance", outputs=names)
    size = np.abs(frf.data).max(axis=(0, 2, 3))
    return frf.sel(output=[n for n, s in zip(names, size, strict=True) if s > _SEEN * size.max()])
