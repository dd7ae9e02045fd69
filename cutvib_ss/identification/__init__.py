"""Of the cutting head first guess (Eqs. 14-20), bounded fit (Eqs. 21-22) and what the data determine; poles of any record."""

from cutvib_ss.identification.bounded_fit import HeadFit, bounded_fit, bounds_around
from cutvib_ss.identification.first_guess import first_guess, peaks_and_dip
from cutvib_ss.identification.fitted_data import FitData, FitWeights, fit_data
from cutvib_ss.identification.held_head import held_natural_frequencies, held_peaks, held_response
from cutvib_ss.identification.identify import IdentificationResult, identify
from cutvib_ss.identification.rail_mass import RailMass, recover_rail_mass
from cutvib_ss.identification.stabilisation import Stabilisation, stabilisation
from cutvib_ss.identification.tool_side import tool_side
from cutvib_ss.identification.uncertainty import Determination, Estimate, determination

__all__ = [
    "identify",
    "IdentificationResult",
    "first_guess",
    "peaks_and_dip",
    "held_response",
    "held_natural_frequencies",
    "held_peaks",
    "fit_data",
    "FitData",
    "FitWeights",
    "bounded_fit",
    "bounds_around",
    "HeadFit",
    "determination",
    "Determination",
    "Estimate",
    "stabilisation",
    "Stabilisation",
    "tool_side",
    "recover_rail_mass",
    "RailMass",
]
