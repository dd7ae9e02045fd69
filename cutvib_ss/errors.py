"""The error tree: every error a user can cause says what was wrong, the value, and what to do."""


class CutvibError(Exception):
    """Base of all errors that the package raises on purpose."""


class ParameterError(CutvibError, ValueError):
    """A parameter or argument is impossible: a negative mass, a position outside the rail, an unknown key."""


class CouplingError(CutvibError):
    """Subsystems cannot be joined, or a model has no finite linear time-invariant plant."""


class DataFormatError(CutvibError, ValueError):
    """A file is missing, truncated, of another format or unit, or holds values that cannot be measurements."""


class IdentificationError(CutvibError):
    """The data do not determine what was asked of them."""


class DiagnosisError(CutvibError):
    """A campaign is readable but cannot carry a diagnosis."""


class DesignError(CutvibError):
    """A controller cannot be designed: no solution, or one that does not keep what it promises."""


class ConvergenceError(CutvibError):
    """A nonlinear response runs away, or what was asked of it, such as a steady state, is not found."""
