"""Out to other programs, and back: frequency responses as CSV, UFF, MAT and NPZ; plants over
positions as MAT and NPZ; responses in time as CSV and NPZ; travels from CSV."""

from cutvib_ss.interchange.files import staged
from cutvib_ss.interchange.frf_files import frf_csv, read_frf, write_frf
from cutvib_ss.interchange.schedule_files import write_schedule
from cutvib_ss.interchange.time_files import read_time_response, write_time_response
from cutvib_ss.interchange.travel_files import read_travel

__all__ = [
    "frf_csv",
    "read_frf",
    "read_time_response",
    "read_travel",
    "staged",
    "write_frf",
    "write_schedule",
    "write_time_response",
]
