"""Work spread over processes."""

import os
import signal
import subprocess
import sys
from functools import partial
from types import MappingProxyType

import pytest

from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import value_at


def test_order_and_results_are_those_of_one_process():
    numbers = [(7, 3), (2, 5), (9, 4), (1, 1)]
    with Workers(2) as two:
        assert two.map(divmod, *zip(*numbers, strict=True)) == Workers().map(divmod, *zip(*numbers, strict=True))


def test_models_and_their_tables_travel_and_so_do_errors():
    machine = EndFixity("rail_ends", 1e4, 2e4).apply(published_machine())
    with Workers(2) as two:
        assert two.map(len, [MappingProxyType({"a": 1}), MappingProxyType({})]) == [1, 0]
        paths = [("head", "k1"), ("rail", "parameters", "mass")]
        assert two.map(partial(value_at, machine), paths) == [value_at(machine, p) for p in paths]
        with pytest.raises(ParameterError, match="k_left"):
            two.map(partial(EndFixity, "rail_ends"), [1e4, -1.0], [1e4, 1e4])


KILLED = """
import time
from cutvib_ss.diagnosis.workers import Workers
if __name__ == "__main__":
    with Workers(2) as two:
        print(two.map(divmod, [7, 9], [3, 4]), flush=True)
        time.sleep(60)
"""


@pytest.mark.skipif(os.name != "posix", reason="kills as POSIX does")
def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    script = tmp_path / "killed.py"
    script.write_text(KILLED)
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout.readline() == "[(2, 1), (2, 1)]\n"
        parent.send_signal(signal.SIGKILL)
        # The workers hold the other end of this pipe: it ends with the last of them.
        assert parent.communicate(timeout=20) == ("", None)
