"""Balanced reduction of plants and controllers, names kept, errors recomputed."""

from __future__ import annotations

import warnings

import control
from slycot.exceptions import SlycotResultWarning

from cutvib_ss.control_design.norms import peak_gain
from cutvib_ss.control_design.synthesis import in_seconds, scaled_in_time
from cutvib_ss.errors import DesignError
from cutvib_ss.parameters import check_number


def reduced(system: control.StateSpace, order: int, match_dc: bool = False) -> control.StateSpace:
    """
    A system of lower order, by balanced truncation.

    Parameters
    ----------
    system : control.StateSpace
        Continuous plant or controller; unstable poles are kept.
    order : int
        Number of states; there are fewer where a minimal realisation has fewer.
    match_dc : bool
        Whether to keep the static response (singular perturbation) instead of the one at high frequency.

    Returns
    -------
    control.StateSpace
        Signals named as before; the system itself where it has no more states.

    Raises
    ------
    DesignError
        If the system is sampled, or has more unstable poles than that.

    Notes
    -----
    The error of a stable system's truncation is at most twice the sum of the Hankel singular values cut off (Glover 1984).
    """
    check_number("order", order, 1)
    if system.dt:
        raise DesignError(
            "reduce the continuous controller; python-control's reduction takes a sampled one for continuous"
        )
    if order >= system.nstates:
        return system
    scaled, rate = scaled_in_time(system)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SlycotResultWarning)  # says that the minimal order is lower
            small = control.balanced_reduction(scaled, order, "matchdc" if match_dc else "truncate")
    except (ValueError, ArithmeticError) as error:
        raise DesignError(f"no balanced reduction to {order} states ({' '.join(str(error).split())})") from error
    return control.ss(
        in_seconds(small, rate), inputs=system.input_labels, outputs=system.output_labels, name=system.name
    )


def smallest_controller(
    controller: control.StateSpace, plant: control.StateSpace, loss: float = 0.1, output: str = "tool_x"
) -> control.StateSpace:
    """
    The controller of lowest order that closes nearly the same loop.

    Parameters
    ----------
    controller : control.StateSpace
        Continuous controller.
    plant : control.StateSpace
        The plant that it was designed on, from `control_plant`.
    loss : float
        How far the response of the motion to the cutting force may move: H∞ norm of the difference over that of the response.
    output : str
        The motion.

    Returns
    -------
    control.StateSpace
        The reduced controller; the one given where none is good enough.

    Notes
    -----
    Judged by the closed loop, for a controller that is close to another says little: what matters lies around the crossover.
    """
    m, p = controller.noutputs, controller.ninputs

    def closed(k: control.StateSpace) -> control.StateSpace:
        loop = plant.lft(k, m, p)
        return loop[plant.output_labels.index(output), 0]

    whole = closed(controller)
    allowed = loss * peak_gain(whole)
    for order in range(1, controller.nstates):
        try:
            small = reduced(controller, order)
        except DesignError:
            continue
        loop = closed(small)
        if loop.poles().real.max() < 0.0 and peak_gain(whole - loop) <= allowed:
            return small
    return controller
