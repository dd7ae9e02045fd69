"""Out to other programs, and back: frequency responses as CSV, UFF, MAT and NPZ; plants over positions as MAT and NPZ."""

from cutvib_ss.interchange.files import staged
from cutvib_ss.interchange.frf_files import frf_csv, read_frf, write_frf
from cutvib_ss.interchange.schedule_files import write_schedule

__all__ = ["frf_csv", "read_frf", "staged", "write_frf", "write_schedule"]
