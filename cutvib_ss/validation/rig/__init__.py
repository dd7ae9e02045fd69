"""
The virtual machine of the sealed trial: flexible multibody dynamics (exudyn), hammer blows, sensors, files.

It shares no modelling code with the package that diagnoses.
"""

try:
    import exudyn  # noqa: F401
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("the virtual machine needs exudyn: pip install cutvib_ss[rig]", name="exudyn") from error

from cutvib_ss.validation.rig.cases import CAUSES, OUTSIDE_KINDS, TRAITS, Case, draw_case, write_campaign

__all__ = ["CAUSES", "OUTSIDE_KINDS", "TRAITS", "Case", "draw_case", "write_campaign"]
