"""Every number of judgement of the diagnosis: unit, meaning, effect of a larger value, source; shown in `docs/settings.md`."""

# ruff: noqa: RUF009 - the call makes a field
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Weighted = tuple[tuple[float, float], ...]
_JUDGEMENT = "judgement"
_TIME = "computing time"
_NUMERICAL = "numerical accuracy"
_SIMULATED = "simulated campaigns of known cause"
_STATISTICS = "statistics"


def _of(value: Any, unit: str, meaning: str, effect: str, source: str) -> Any:
    """A field with its description."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "effect": effect, "source": source})


# fmt: off
@dataclass(frozen=True, kw_only=True)
class Settings:
    """Numbers of judgement of the diagnosis."""

    # Records and their bands
    record_noisy: float = _of(5.0, "1",
        "Noise, as a multiple of its level in the quiet part of the spectrum, where the band ends",
        "wider bands with noisier ends", _JUDGEMENT)
    record_below_first_mode: float = _of(0.6, "first natural frequency",
        "Where the band begins: below, accelerance drowns in drift", "narrower bands", _JUDGEMENT)
    record_beyond_mode: float = _of(1.2, "highest natural frequency of a structure's model",
        "Above which a resonance of the records is none of the model's", "fewer bands are cut",
        "stiffness off by 40 %, more than any tolerance, moves a mode so far")
    record_prominence: float = _of(6.0, "dB", "Prominence of such a resonance", "fewer bands are cut",
        "an isolated mode of 10 % damping has 14 dB, a response between antiresonances hardly any")
    record_same_resonance: float = _of(0.03, "relative", "By which it may differ between records", "chance peaks are taken for one",
        "drift moves frequencies by a percent at the most")
    record_below_resonance: float = _of(1.1, "its frequency over the band's end", "Where the band ends below such a resonance",
        "narrower bands", "residual modes hold what it does there")
    record_median_lines: int = _of(7, "lines", "Lines over whose median a response's power is compared with the noise",
        "narrow dips are kept", _STATISTICS)
    record_lost: float = _of(0.05, "1",
        "Error by the steps of a converter, over the response, from which a channel's lines are left out: "
        "it is alike in all lines of a mode and in all records, which the likelihood takes for told by each",
        "more lines, and more gaps that a converter made", _JUDGEMENT)
    record_lost_over: float = _of(20.0, "Hz", "Over which both are averaged", "-", "some widths of a resonance")
    record_heard: float = _of(4.0, "1",
        "Response power over noise power below which a line is left out: noise on the force biases the estimate",
        "fewer lines", _JUDGEMENT)
    record_most_bias: float = _of(0.5, "1", "Part of the force's power that is its noise, up to which the bias of H1 is taken off",
        "noisier lines", "beyond it the line is left out as not heard")
    record_late_together: float = _of(3.0, "std", "Of the mean of jittering delays, beyond which a channel is late besides",
        "more delays are taken for jitter", _STATISTICS)
    record_late_passes: int = _of(2, "passes", "In which records are moved by their mean delays", "longer", _TIME)
    record_lasting: float = _of(10.0, "squares of the noise",
        "Sum over all lines of what closed form and simulation of blows differ by, from which both are tried",
        "faster", "half of it is in nats what it may shift evidence by")
    record_least_noise: float = _of(1e-4, "of the response",
        "Standard deviation below which none is believed that was read off how smooth a response is",
        "noise-free data are believed less", "force and response channels are linear to no better")
    record_fewest_lines: int = _of(8, "lines", "Lines that a record needs", "short records are refused",
        "a resonance has four unknowns, a complex line tells two; as many again judge the fit")
    record_blow_at: float = _of(0.05, "s", "Assumed instant of a blow that no record states", "-", _JUDGEMENT)
    record_blow_at_std: float = _of(0.05, "s", "Prior standard deviation of that instant", "the instant is freer", _JUDGEMENT)
    record_same_level: float = _of(1.05, "1", "Ratio of levels up to which two records are repetitions",
        "more repetitions, and level dependence taken for scatter", "hands and shakers repeat a level to some percent")

    # Likelihood
    likelihood_drift_sizes: Weighted = _of(
        ((3e-5, 0.10), (1e-4, 0.10), (3e-4, 0.15), (1e-3, 0.25), (3e-3, 0.25), (1e-2, 0.12), (3e-2, 0.03)),
        "relative std, probability", "Prior of the drift between sessions", "differences between sessions are forgiven",
        "machines repeat to 0.1-2 %, rarely worse")
    likelihood_within_sizes: Weighted = _of(
        ((1e-6, 0.55), (3e-5, 0.05), (1e-4, 0.08), (3e-4, 0.12), (1e-3, 0.12), (3e-3, 0.06), (1e-2, 0.02)),
        "relative std, probability", "Prior of the drift from record to record within a session",
        "what differs between levels is forgiven", "machines warm and settle while they are struck, by less than overnight")
    likelihood_nominal_sizes: Weighted = _of(
        ((3e-5, 0.15), (1e-4, 0.15), (3e-4, 0.20), (1e-3, 0.25), (3e-3, 0.15), (1e-2, 0.08), (3e-2, 0.02)),
        "relative std, probability", "Prior of the discrepancy of the nominal model's elements",
        "small causes are taken for model error",
        "finite elements and modal models of machined parts err by tenths of a percent in dynamic stiffness once tuned")
    likelihood_cause_sizes: Weighted = _of(
        ((1e-3, 0.10), (3e-3, 0.15), (1e-2, 0.25), (3e-2, 0.30), (1e-1, 0.15), (3e-1, 0.05)), "relative std, probability",
        "Prior of the discrepancy of the cause itself", "causes of the wrong form are forgiven",
        "constitutive models of joints, contacts and losses hold to some percent, seldom to a tenth of that")
    likelihood_parts_sizes: Weighted = _of(
        ((1e-3, 0.25), (1e-2, 0.15), (3e-2, 0.15), (0.1, 0.20), (0.3, 0.15), (1.0, 0.10)), "tolerances, probability",
        "Prior of errors of single parts of a structure's stiffness and mass", "causes at one place are taken for model error",
        "the tolerance of a matrix is that of all of it; parts differ among each other by less")
    likelihood_losses_sizes: Weighted = _of(
        ((1e-3, 0.15), (3e-2, 0.15), (0.1, 0.20), (0.3, 0.25), (1.0, 0.20), (3.0, 0.05)), "tolerances, probability",
        "The same of the losses of single modes", "causes of damping are taken for model error",
        "measured modal dampings scatter by 20-50 % about any law, single ones by a factor of two")
    likelihood_flexibility_sizes: Weighted = _of(
        ((1e-4, 0.30), (1e-3, 0.10), (1e-2, 0.20), (3e-2, 0.12), (0.1, 0.12), (0.3, 0.10), (1.0, 0.06)),
        "of what a port's mass gives way at such a mode's frequency, probability",
        "Prior of the flexibility of residual modes, which a structure's model leaves out",
        "causes that act above the band are taken for it",
        "a mode of a bar moves a part of what its mass does, one of a thousand parts a thousandth; some models hold all")
    likelihood_residual_modes: tuple[float, ...] = _of((1.05, 1.15, 1.4, 2.0, 4.0), "highest natural frequency or line",
        "Frequencies of residual modes", "nothing close above the band is held",
        "distances grow in proportion: any modes above the first are held to some percent of what they do")
    likelihood_noise_factors: Weighted = _of(
        ((0.1, 0.005), (0.3, 0.02), (0.7, 0.075), (1.0, 0.65), (1.3, 0.18), (2.0, 0.055), (4.0, 0.01), (10.0, 0.004),
         (100.0, 0.001)),
        "factor on the variance, probability", "Prior of the noise against its estimate", "residuals are taken for noise",
        "estimates from 5-20 repetitions; on a machine that is not linear part of what scatters is its own doing")
    likelihood_noise_unknown: Weighted = _of(tuple((float(v), 1.0 / 13.0) for v in np.geomspace(1.0, 1e6, 13)),
        "factor on the variance, probability", "The same where no repetitions told the scatter",
        "residuals are taken for noise", "the noise is then a guess")
    likelihood_most_lags: int = _of(60, "lines", "Lags over which residuals are correlated at most",
        "long correlations are seen", _TIME)
    likelihood_correlated: float = _of(0.1, "1", "Correlation of neighbouring residuals that stands out",
        "less correlation is counted", "twice the scatter of 400 lines")
    likelihood_precision_floor: float = _of(1e-9, "1", "Added precision that keeps a normal matrix regular", "-", _NUMERICAL)
    likelihood_farthest_drift: float = _of(6.0, "std", "How far a session may drift", "outlying sessions are followed",
        _STATISTICS)
    discrepancy_length: float = _of(0.6, "ln(frequency)", "Correlation length of a discrepancy over frequency",
        "smoother discrepancies", "it may change within most of an octave")
    discrepancy_amplitude_length: float = _of(1.0, "ln(amplitude)",
        "The same of a restoring force over the amplitude of its motion", "smoother discrepancies",
        "as over frequency, wider since amplitude spans decades")
    discrepancy_position_length: float = _of(0.3, "rail length", "The same of a cause along the rail over the head's position",
        "smoother discrepancies", "mode shapes of the first two bending or torsional modes differ so by their end conditions")
    discrepancy_modes_drift: float = _of(0.5, "drift of a stiffness",
        "By how much a mode of a structure drifts by itself, beside what moves all modes", "sessions may differ in single modes",
        "springs of chains of three to six that drift one by one: 0.41 to 0.46, and pairs of modes 0.36 to 0.49")
    discrepancy_least_variance: float = _of(1e-3, "1", "Relative variance below which a shape of the process is dropped",
        "fewer shapes", _NUMERICAL)
    discrepancy_points: int = _of(25, "points", "Points of a record that stand for the process behind a cause's discrepancy",
        "longer", _TIME)
    discrepancy_variance_left: float = _of(0.02, "1", "Variance that its pivots may leave", "fewer pivots", _NUMERICAL)
    discrepancy_most_pivots: int = _of(40, "pivots", "Number of its pivots at most", "longer", _TIME)
    calibration_shapes: int = _of(8, "shapes",
        "Polynomials that a calibration error is made of: what a first-order corner or a resonance outside of the band leaves of "
        "1 % is 0.01 %",
        "errors that vary faster over the band", _JUDGEMENT)
    predictive_small_drift: float = _of(1e-4, "relative std", "Drift that moves a response in proportion", "fewer iterations",
        _NUMERICAL)
    predictive_iterations: int = _of(12, "iterations", "In which a larger drift of a held-out session or record is found, at most",
        "longer", _NUMERICAL)
    predictive_gain: float = _of(1e-3, "relative", "Gain of an iteration below which it is the last", "larger errors of the drift",
        _NUMERICAL)

    # Priors and the verdict
    prior_none: float = _of(0.5, "probability", "Prior of no cause", "more 'no_gap'",
        "a machine is measured because somebody doubts its model, but most parts of it are right")
    prior_known: float = _of(0.3, "probability", "Prior of one known cause, shared by all", "more 'explained'", "as above")
    prior_unknown: float = _of(0.1, "probability", "Prior of an unknown element, shared by all ports", "more 'unknown'",
        "as above")
    prior_sums: float = _of(0.1, "probability", "Prior of two causes together", "more pairs", "as above")
    unknown_knots: int = _of(9, "knots", "Knots of an unknown element over the band", "finer functions",
        "two to three an octave and a half, as its correlation length asks")
    unknown_amplitudes: tuple[float, ...] = _of((0.03, 0.3, 3.0), "stiffness of the port at mid band",
        "Standard deviations of an unknown element; each has an equal share of the prior", "larger elements", _JUDGEMENT)
    unknown_poles: int = _of(2, "pairs", "Of poles beside an unknown element at a port, at most", "longer",
        "a smooth function holds no resonance, and two in one part are a rarity")
    unknown_pole_starts: int = _of(46, "frequencies", "Over the band, at which they are tried", "longer",
        "as those of a local resonator")
    unknown_channel: float = _of(3.0, "calibration tolerance",
        "Smallest standard deviation of the error of a channel; the others stand to it as those of an element", "larger errors",
        "an error within the stated tolerance is no cause; of a thousand channels three err by more than three of it")
    unknown_stations: tuple[float, ...] = _of((0.2, 0.35, 0.5, 0.65, 0.8), "y/L",
        "Points from which an unknown element moves along the rail",
        "more starts", "a start at midspan ends at the mirror image of a point between; half a wave of the third mode apart")
    unknown_level_spacing: float = _of(0.8, "ln(amplitude)",
        "Spacing of the knots of an unknown restoring force over the level of the motion", "coarser functions",
        "somewhat below its correlation length")
    unknown_farthest: float = _of(50.0, "std", "How far its coefficients are followed", "-", _NUMERICAL)
    verdict_sure: float = _of(0.9, "probability", "From which a cause is named", "fewer named causes, fewer of them wrong",
        "one in ten of what is called sure may be wrong")
    verdict_set: float = _of(0.95, "probability", "That the ambiguity set and the set of places carry", "larger sets",
        "the usual level of a credible set")
    verdict_half: float = _of(0.5, "probability", "From which no cause, or an unknown one, is the verdict",
        "fewer such verdicts", "more probable than not")
    verdict_noise: float = _of(1.1, "χ² per datum", "On held-out records, up to which a second cause counts as known",
        "second causes are believed that leave more", "as search_enough")
    verdict_misfit: float = _of(2.0, "χ² per datum",
        "On held-out records, from which the re-tuned model is no answer, a cause not sure, and a restoring force not enough",
        "more gaps are called none, fewer pairs", "noise estimated from a few blows is right to a factor below two")
    verdict_closed: float = _of(0.97, "excess", "That a cause alone has to close to be the answer where no second one is known",
        "more answers say that something is left", "restoring forces and supports hold to ten or twenty percent: squared, a few")
    verdict_size: float = _of(1.96, "standard deviations", "That a cause's size has to lie from nothing", "fewer causes are named",
        "a normal posterior's 95 % interval holds nothing below")
    verdict_form: float = _of(0.6, "probability",
        "That an answer keeps whose model errs by more than is believed, by a parameter, its discrepancies or on held-out records, "
        "and an unknown element, which may be a known cause in another form",
        "more such answers are sure",
        "a right model needs both in one campaign of a thousand, by their priors; the rest is judgement")
    verdict_hardly: float = _of(0.01, "probability", "Below which a cause is not looked at again", "longer", _TIME)
    verdict_judged: int = _of(3, "causes", "Causes judged on held-out records while they carry any probability", "longer",
        _TIME)

    # One fit
    fit_tuned_away: float = _of(3.0, "tolerances",
        "By which a tuned value is off where causes that move it are fitted in any case", "longer",
        "one of 370 right models has a given value that far out")
    fit_strained: float = _of(5.0, "tolerances",
        "Of a tuned value beside a restoring force, from which another cause stands behind it", "second causes are rarer",
        "one normal value in a million; tolerances are stated roughly, and right restoring forces were seen with 4")
    fit_gain: float = _of(0.1, "objective", "Gain at which steps end", "coarser fits",
        "a twentieth of what tells two causes apart by a factor of e")
    fit_rough_gain: float = _of(1e-3, "of all gained before", "Gain at which steps end where records are simulated or drift "
        "by themselves", "rougher", _TIME)
    fit_passes: int = _of(3, "climbs", "Times that a fit climbs at most", "longer", _TIME)
    fit_promise: float = _of(0.1, "needed gain", "That a whole step has to promise to be tried",
        "starts far from the truth are given up", _TIME)
    fit_trail: int = _of(3, "steps", "By which the next one is extrapolated", "longer memory", _NUMERICAL)
    fit_scout_steps: int = _of(10, "steps", "A fit of no more steps climbs once", "more scouts", _TIME)
    fit_start_lines: int = _of(120, "lines", "Lines on which drifting sessions are started", "longer", _TIME)
    fit_fewer_lines: int = _of(300, "lines", "Of a record, on which a linear cause is fitted before all are taken", "longer", _TIME)
    fit_start_error: float = _of(0.1, "1", "Relative error added to those", "smoother objective", _JUDGEMENT)
    fit_start_gain: float = _of(1e-2, "1", "Relative gain at which those steps end", "rougher starts", _TIME)
    fit_instants: int = _of(4, "1", "Instants of the blow that are tried within a period of the slowest mode, to either side",
        "longer", "a start within a sixth of a period leads to the optimum")
    fit_hopeless: float = _of(5.0, "χ² per datum", "From which a fit is not worth small steps", "longer", _TIME)
    fit_hopeless_gain: float = _of(1e-3, "1", "Relative gain at which such a fit ends", "rougher", _TIME)
    fit_run_away: float = _of(1e16, "χ² per datum", "From which a model has run away", "-", _NUMERICAL)
    fit_most_damping: float = _of(0.9, "1", "Damping ratio of the rail beyond which none is followed", "-", _NUMERICAL)
    fit_within: float = _of(8.0, "std", "How far a tuned value or calibration error is followed", "-",
        "its prior holds it long before")
    projection_step: float = _of(0.05, "std", "Step of tuning and shape in a difference of two closed forms", "-", _NUMERICAL)
    projection_shape_steps: float = _of(40.0, "1", "Range of a shape over its unit", "smaller units", _NUMERICAL)
    projection_tries: int = _of(8, "dampings", "Tried for a step", "longer", _NUMERICAL)
    projection_gain: float = _of(1e-2, "1", "Relative gain at which its steps end", "rougher", _TIME)
    tail_died_out: float = _of(-10.0, "Re(s)·T", "Below which a mode leaves nothing at the block's end: 5e-5 of itself",
        "fewer modes in the tail", _NUMERICAL)
    tail_widened: float = _of(-4.0, "Re(s)·T", "The same beside a noise widened to some percent: 2 % of itself",
        "fewer modes in the tail", _TIME)
    tail_force: float = _of(1e-3, "peak force", "Below which a sample of a blow is no part of it", "shorter blows",
        "sensor noise between blows would ring in the tail")
    tail_force_noise: float = _of(0.02, "peak force", "Most that is taken for noise of the force", "shorter blows",
        "a push may fill its record; noisier blows only take longer")
    leakage_poles: float = _of(1.5, "band end", "Up to which poles of a model leak", "more poles",
        "beyond, what a block's window spreads of them is smooth over the band")
    leakage_alike: float = _of(1e-9, "1", "Below which parts of a change are told from no other", "-", _NUMERICAL)
    tail_points: int = _of(16, "points", "On each circle around a pole: with the radius, 0.4^16 = 4e-7 of the tail", "longer",
        _NUMERICAL)
    tail_points_widened: int = _of(8, "points", "The same beside a noise widened to some percent: 7e-4 of the tail", "longer",
        _TIME)
    tail_radius: float = _of(0.4, "distance",
        "Radius of each circle, of its pole's distance from the line s = σ + jω and other poles", "less accurate", _NUMERICAL)

    # Simulation of causes that depend on the level
    simulation_tuning_step: float = _of(0.02, "std", "Step of a tuned value in a difference of two closed forms", "-",
        _NUMERICAL)
    simulation_law_step: float = _of(2e-4, "range", "Step of a restoring force's parameter in a difference of two simulations", "-",
        _NUMERICAL)
    simulation_linear_step: float = _of(2e-6, "range", "The same of a linear cause's, which moves it smoothly", "-",
        _NUMERICAL)
    simulation_harmonics: int = _of(3, "harmonics", "Balanced in sine sweeps; the first is compared", "longer", _NUMERICAL)
    simulation_force_scale: float = _of(0.2, "1", "Relative error of a force that no record holds",
        "looser fits of such records", "hands scatter, and the blow's length is a guess")
    simulation_force_scale_step: float = _of(0.02, "std", "Its step in a difference of two simulations", "-", _NUMERICAL)
    simulation_force_offset: float = _of(0.1, "rms force",
        "Standard deviation of a constant force beside that of a continuous recording", "friction and clearance fit more",
        "weights, cables and amplifiers' zeros are some percent of what excites")
    simulation_early_jump: float = _of(0.25, "1",
        "Part of the lines between two folds by which a sweep may jump before the one to which it goes",
        "less is learnt from where a sweep jumps", _JUDGEMENT)
    simulation_branches_apart: float = _of(1e-3, "1",
        "Difference of two branches, of the largest response, from which a line lies between folds", "-", _NUMERICAL)
    simulation_static_above: float = _of(5.0, "band", "Modes so far above the band yield statically to nonlinear forces",
        "longer", _NUMERICAL)
    simulation_classical_above: float = _of(20.0, "band", "Damping couples no mode so far above the band", "longer", _NUMERICAL)
    simulation_steps: float = _of(20.0, "steps a period",
        "On all lines: χ² errs by 1e-6 of a degree of freedom for smooth forces, 3e-4 for friction, which takes twice as many",
        "longer", _NUMERICAL)
    simulation_rough_steps: float = _of(10.0, "steps a period", "The same on few lines: 1e-3 and 1e-2", "longer", _NUMERICAL)
    simulation_hysteresis_at: float = _of(100.0, "Hz", "Where hysteretic damping is made viscous for stepping in time", "-",
        "the first modes of machines of this size")
    level_blows: int = _of(3, "blows", "Of a record that are compared one by one", "fewer such comparisons",
        "a mean, what orders with the force, and one to judge it by")
    level_drift: float = _of(0.05, "probability",
        "Of drift that orders with the level by chance as much as it does, from which restoring forces are looked for all the same",
        "more searches in vain", _TIME)
    level_hiding_drift: float = _of(3e-3, "relative std", "Of drift between sessions of a level each, from which it may hide a "
        "restoring force, and these are looked for", "fewer searches", "machines repeat to 0.1-0.3 % in most cases")
    level_trend: float = _of(0.25, "probability",
        "That drift within sessions is a trend in time and goes with the level, since all were measured in its order",
        "surer linear answers", "half of all drift is warming; of two orders of the levels half are the same in all sessions")
    level_ordered: float = _of(1e-4, "probability",
        "Of blows that order with their force by chance as much as they do, from which it is nonlinearity",
        "more records are called nonlinear", _STATISTICS)
    comparison_common_lines: int = _of(8, "lines", "That two records must share to be compared", "fewer comparisons",
        _JUDGEMENT)
    comparison_same_line: float = _of(1e-3, "spacing", "Within which two lines are the same", "-", _NUMERICAL)
    comparison_halved: float = _of(4.0, "1",
        "By how much a cubic spline's error grows with twice the spacing, at least: by 16 where lines are dense, by less on a peak",
        "interpolated records are trusted more", _JUDGEMENT)
    comparison_neighbours: int = _of(9, "lines", "Of which the largest such error is taken",
        "interpolated records are trusted less", _JUDGEMENT)
    comparison_tail_error: float = _of(0.3, "1", "Relative error of what unlike blocks cut off, where a model tells it",
        "less weight on cut responses", _JUDGEMENT)
    level_lines: int = _of(24, "lines", "Over which the scatter between levels is averaged",
        "narrow effects of the level are missed", _STATISTICS)
    level_stands_out: float = _of(5.0, "std", "By which that has to exceed one, somewhere", "less level dependence is seen",
        _STATISTICS)
    level_noise_error: float = _of(0.15, "1", "Added to it, for the noise itself is an estimate",
        "less level dependence is seen", _STATISTICS)
    level_apart: float = _of(1.5, "1", "Ratio of levels from which a level-dependent response would show",
        "fewer campaigns compare levels", _JUDGEMENT)
    level_excess: float = _of(1.15, "χ² per datum", "Between levels, from which a response is called level-dependent",
        "less level dependence is reported", _STATISTICS)

    # Search
    search_coarse_lines: int = _of(120, "lines", "Of a group, on which starts are fitted", "longer", _TIME)
    search_coarse_error: float = _of(0.03, "1", "Relative error by which their noise is widened",
        "weak causes are passed over", _JUDGEMENT)
    search_coarse_gain: float = _of(1e-2, "1", "Relative gain at which their steps end", "rougher", _TIME)
    search_outlook_positions: int = _of(3, "positions", "On which starts of level-dependent causes are fitted", "longer",
        _TIME)
    search_close: float = _of(60.0, "objective", "Behind the best on few lines, up to which a cause is fitted on all",
        "longer", _TIME)
    search_most_close: int = _of(5, "causes", "So fitted at most: where many are alike, none of them is the cause", "longer",
        _TIME)
    search_far: float = _of(400.0, "objective", "Behind the best, from which no cause is fitted on all lines", "longer",
        _TIME)
    search_start_steps: int = _of(3, "steps", "From each start", "longer", _TIME)
    search_starts_climbed: int = _of(3, "starts", "Of a cause from which steps are taken", "longer", _TIME)
    search_starts_most: int = _of(8, "starts", "The same while they leave more than the widened noise", "longer", _TIME)
    search_later_steps: int = _of(10, "steps", "On few lines, from the best start of a cause", "longer", _TIME)
    search_law_steps: int = _of(6, "steps", "The same of a restoring force", "longer", _TIME)
    search_instants: int = _of(2, "1", "The same as `fit_instants`, with the discrepancy, of the best fit", "longer", _TIME)
    search_most_steps: int = _of(40, "steps", "On all lines", "longer", _TIME)
    search_most_law_steps: int = _of(15, "steps", "The same of a restoring force: the last of many gain little", "longer", _TIME)
    search_first_order: float = _of(20.0, "χ² per datum",
        "Of the tuned model, from which all linear causes are fitted, since what one would take away to first order says little",
        "faster", _JUDGEMENT)
    search_moving: int = _of(3, "causes", "Of the best linear causes that are fitted to every record by itself", "longer", _TIME)
    search_scouted: int = _of(9, "causes",
        "Linear causes that promise most from the tuned model, and as many from the untuned one, that are fitted",
        "longer", "the true cause was within the first three of one or the other of 16 simulated machines, but for one")
    search_parts_leading: int = _of(2, "causes", "That lead beside errors of a structure's parts, fitted on all lines too",
        "longer", _TIME)
    search_linear_refined: int = _of(3, "causes", "Linear causes fitted on all lines, at least", "longer", _TIME)
    search_laws_refined: int = _of(3, "causes", "Simulated causes fitted on all lines, at most", "longer", _TIME)
    search_laws_looked_at: int = _of(6, "causes", "Simulated causes whose scan is refined: the most promising", "longer",
        _TIME)
    search_laws_started: int = _of(3, "causes", "Of these, fitted on few lines", "longer", _TIME)
    search_unknown_climbed: int = _of(8, "elements", "Of unknown form that lead after their first steps, and take more", "longer",
        _TIME)
    search_unknown_refined: int = _of(3, "elements",
        "Sites of unknown elements, alone and beside a cause, that are given their own amplitude", "longer", _TIME)
    search_hopeless: float = _of(3.0, "χ² per datum", "On few lines, from which a simulated cause is not fitted on all",
        "longer", _TIME)
    search_enough: float = _of(1.1, "χ² per datum", "Below which the re-tuned model needs no cause if the level shows nothing",
        "small gaps are not searched", "five standard deviations of χ² of 5000 data")
    search_small: float = _of(2.0, "χ² per datum",
        "Below which restoring forces are looked for beside the tuned model, as measured, not from afar", "more from beside",
        "the residual is less than the noise itself")
    search_caught: float = _of(5.0, "log evidence",
        "Lead of a cause from which there is a gap, and the model without one is tuned again from there",
        "local minima of the re-tuned model stay; small gaps are not searched", "a factor of 150")
    search_left: float = _of(1.05, "χ² per datum", "Below which nothing is tried beside the best cause", "fewer pairs", _TIME)
    search_left_of_gap: float = _of(2e-4, "gap", "Added to it", "fewer pairs", _TIME)
    search_leads: float = _of(0.1, "excess", "That a single cause has to take away before a second is tried on top",
        "fewer pairs", "else neither is known")
    search_odd: float = _of(10.0, "χ² per datum", "Of one channel of a record under what leaves no more than noise of all others: "
        "from there it is left out", "fewer records are left out", "friction that shows that much in one shows in its neighbours")
    search_odd_share: float = _of(0.125, "records", "That are left out, at most", "more records may be left out",
        "what shows in more of them may be the machine")
    scan_records: int = _of(5, "records", "Up to which all are scanned", "longer", _TIME)
    scan_steps: int = _of(10, "steps", "Of the fit underneath a scan", "longer", _TIME)
    scan_gain: float = _of(1e-2, "1", "Relative gain at which they end", "rougher", _TIME)
    scan_nudge: float = _of(0.02, "range", "By which a parameter is moved off a start that does nothing", "-", _NUMERICAL)
    scan_nothing: float = _of(1e-3, "squares a datum", "Below which a start does nothing", "weak starts are moved",
        "so much the estimator's own sums may differ")
    scan_simplex: float = _of(0.05, "range", "Size of the simplex from which a restoring force's best values are refined", "-",
        _NUMERICAL)
    scan_evaluations: int = _of(12, "evaluations a parameter", "In which they are", "longer", _TIME)
    scan_shapes: int = _of(5, "shapes", "Of a restoring force that are scanned in proportion to its strength", "longer", _TIME)
    scan_in_proportion: float = _of(0.01, "χ² per datum", "Up to which a restoring force changes in proportion to its strength",
        "steps from afar", _NUMERICAL)
    scan_weaker: int = _of(4, "tries", "In which such a strength is found", "longer", _TIME)
    scan_extrapolated: float = _of(4.0, "weakest start", "Up to which a force in proportion to its parameter is scaled", "-",
        _NUMERICAL)
    pairs_astray: float = _of(10.0, "χ² per datum", "On few lines, from which no restoring force is looked for in pairs", "longer",
        _TIME)
    pairs_close: float = _of(15.0, "objective", "As search_close, of pairs", "longer", _TIME)
    pairs_first: int = _of(2, "causes", "Single causes to which a second one is added", "longer", _TIME)
    pairs_seconds: int = _of(9, "causes", "Second causes fitted on each", "longer", _TIME)
    pairs_law_seconds: int = _of(3, "causes", "The same where one of the two is simulated", "longer", _TIME)

    # Held-out records
    held_out_steps: int = _of(5, "steps", "Of a fit on some records from the fit on all", "longer",
        "that lies within its own uncertainty of it")
    held_out_gain: float = _of(1e-4, "1", "Relative gain of the objective at which those steps end", "rougher", _TIME)
    held_out_law_steps: int = _of(3, "steps", "The same of a restoring force", "longer", _TIME)
    held_out_force_steps: int = _of(3, "steps", "To the force scale of a held-out record whose force is guessed", "longer",
        _NUMERICAL)
    held_out_blows_differ: float = _of(0.5, "std", "By which force scales of its single blows may differ from their mean",
        "scattered blows are judged", _JUDGEMENT)
    held_out_length_differs: float = _of(0.1, "1", "Relative difference of a blow's length from its guess",
        "wrong guesses are judged", _JUDGEMENT)
    held_out_bootstraps: int = _of(2000, "draws", "Resamplings of the records behind an interval", "longer", _STATISTICS)

    # The place, and unknown dynamic stiffness
    place_lines: int = _of(60, "lines", "Of a group, on which places are compared", "longer", _TIME)
    place_climbed: int = _of(2, "variants", "Of each place, fitted with all steps", "longer", _TIME)
    place_climbs: int = _of(4, "steps", "Of the tuning", "longer", _TIME)
    place_disturbed: float = _of(0.95, "probability",
        "Of the measurement, where tones or trigger jitter disturb it and nothing else is at fault", "-", _JUDGEMENT)
    place_far: float = _of(10.0, "mean square",
        "Left by a variant after its first step, over the least of any, from which it takes no more", "longer",
        "further steps took away less than half of it, of restoring forces in simulated machines")
    place_folds: int = _of(3, "folds", "In which positions are left out", "longer", _STATISTICS)
    place_sharpness: float = _of(0.2, "1", "Weight of a datum's evidence: lines of one resonance repeat each other",
        "surer places", _SIMULATED + ", one in three of a restoring force outside the catalogue")
    place_doubt: float = _of(0.01, "probability", "Spread evenly over all places", "less sure places", "as place_sharpness")
    place_held_out: float = _of(0.25, "1", "Weight of the residual at held-out positions, against that at all",
        "places that predict other positions gain", _JUDGEMENT)
    place_smooth: float = _of(0.5, "1", "Weight of what smooth functions leave where every record has its own",
        "places of smooth functions gain", _JUDGEMENT)
    place_by_record: float = _of(2 / 3, "1", "Weight of that view, against functions by level", "-", _JUDGEMENT)
    place_shown: float = _of(0.05, "probability", "From which a place's functions are kept", "fewer", "size of the result")
    place_most_shown: int = _of(2, "places", "Whose functions are kept at most", "more", "size of the result")
    stiffness_model_error: float = _of(0.01, "1", "Relative error of a response that no parameter explains",
        "smoother functions", _JUDGEMENT)
    stiffness_tail_error: float = _of(0.3, "1", "Relative error of what the blocks cut off", "less weight on cut responses",
        "that is taken from the model without the elements")
    stiffness_steps: int = _of(10, "steps", "From afar, at most", "longer", _TIME)
    stiffness_steps_nearby: int = _of(4, "steps", "From close by, at most", "longer", _TIME)
    stiffness_gain: float = _of(1e-3, "1", "Relative gain at which they end", "rougher", _TIME)
    stiffness_degree: int = _of(10, "degree", "Of a smooth function of ln(frequency)", "rougher functions", _JUDGEMENT)
    stiffness_reweighted: int = _of(8, "times", "That lines far from it are given less weight", "longer", _NUMERICAL)
    type_explains: float = _of(0.9, "1", "Part of a function's weighted squares that a named type explains",
        "fewer are named", _JUDGEMENT)
    type_simpler: float = _of(0.5, "1", "Residual of a type of more parameters, over a simpler one's",
        "richer types are named", _JUDGEMENT)
    type_floor: float = _of(0.02, "1", "Relative error that no type is asked to beat", "simpler types are named",
        "as stiffness_model_error")
    type_resonances: int = _of(60, "frequencies", "Tried for a sprung mass", "longer", _NUMERICAL)
    type_dampings: tuple[float, ...] = _of((0.005, 0.01, 0.02, 0.05, 0.1), "1", "Damping ratios tried with each", "-",
        _NUMERICAL)
    type_powers: tuple[float, ...] = _of(tuple(p for p in np.linspace(-3.0, 3.0, 61).round(1).tolist() if p != 0.0), "1",
        "Powers of the level that are tried", "-", _NUMERICAL)
    type_changes: float = _of(0.15, "1", "Relative change over the levels below which a function does not depend on them",
        "fewer depend on the level", _JUDGEMENT)
    faults_end_stiffness: float = _of(30.0, "first mode's stiffness", "Of the ends against which they are freed", "-",
        "any would do")
    faults_twist: float = _of(50.0, "first bending frequency",
        "First frequency of the twist against which the rail's is freed", "-", "any far above the band would do")

    # Error bands
    band_stands_out: float = _of(4.0, "std", "By which a band's mean square exceeds that of noise", "fewer bands",
        _STATISTICS)
    band_width: float = _of(5.0, "Hz", "Over which the error is averaged to find them", "weaker and wider bands", _JUDGEMENT)
    band_main_share: float = _of(0.8, "1", "Part of the error above the noise that the main bands hold", "more bands",
        _JUDGEMENT)
    band_smooth: float = _of(4.0, "Hz", "Over which the error is averaged, and below which a gap is closed",
        "fewer, wider bands", _JUDGEMENT)
    band_narrow: int = _of(3, "lines", "That a band has to hold to be shown", "fewer bands", _STATISTICS)
    band_moves: float = _of(1e-3, "probability", "Of centres that spread as much without moving",
        "more bands are said to move", _STATISTICS)

    # Limits, information and plans
    limits_lines: int = _of(120, "lines", "Of a record on which limits are computed, about", "longer", _TIME)
    limits_shapes: int = _of(3, "shapes", "Of a cause that are tried: the first, the middle, the last", "longer", _TIME)
    limits_tail: float = _of(0.05, "probability", "Beyond the bound", "tighter bounds",
        "the usual level of a one-sided bound")
    limits_farthest: float = _of(-6.0, "std",
        "Below zero, beyond which an estimate tells of wrong noise, not of a tighter bound", "-", _STATISTICS)
    limits_small: float = _of(1e-4, "χ²", "Change at which the derivative is taken: 0.01 standard deviations", "less linear",
        _NUMERICAL)
    limits_iterations: int = _of(20, "iterations", "Of the visible size, which changes with a logarithm of itself", "longer",
        _NUMERICAL)
    seen_small: float = _of(2e-4, "peak", "Change of a response that is in proportion to the severity", "-", _NUMERICAL)
    seen_small_law: float = _of(0.01, "peak", "The same of a simulated one, whose steps leave something", "-", _NUMERICAL)
    seen_steps: int = _of(4, "steps", "To that change", "longer", _NUMERICAL)
    seen_smooth: float = _of(20.0, "Hz", "Over which the relative error of a response is one and the same",
        "less is told apart", _JUDGEMENT)
    plan_lines: int = _of(250, "lines", "On which a planned campaign is computed; each stands for several", "longer", _TIME)
    plan_odds: float = _of(19.0, "odds", "At which a cause is told from its rival: 0.95", "larger severities are asked",
        "as verdict_set")
    plan_blow_at: float = _of(0.02, "s", "Instant of the blow in its block", "-", "a usual pretrigger")
    next_positions: int = _of(24, "positions", "Tried for the next test", "longer", _TIME)
    next_positions_laws: int = _of(8, "positions", "The same where causes have to be simulated", "longer", _TIME)
    next_ends: tuple[float, float] = _of((0.04, 0.96), "y_b / L", "First and last of them", "-", "the head stays on the rail")
    next_levels: tuple[float, ...] = _of((1 / 3, 1.0, 3.0), "level measured", "Levels that are tried where there was but one",
        "-", "half a decade either way")
    next_lines: int = _of(150, "lines", "On which causes are simulated", "longer", _TIME)

    # What a cause changes
    consequence_draws: int = _of(200, "draws", "From the covariance", "longer", _STATISTICS)
    consequence_draws_laws: int = _of(24, "draws", "The same of causes that depend on the level", "longer", _TIME)
    consequence_positions: int = _of(6, "positions", "Shown at most", "longer", "size of the result")
    consequence_positions_laws: int = _of(3, "positions", "The same of causes that depend on the level", "longer", _TIME)
    consequence_modes: int = _of(8, "modes", "Of the rail on which a controller is checked, at least", "longer", _NUMERICAL)
    metric_lines: int = _of(5, "lines",
        "Over which a measured chordal distance is averaged: noise alone lies anywhere on the sphere",
        "narrow differences are missed", _STATISTICS)
    metric_one_in: float = _of(20.0, "records", "In one of which noise exceeds its stated distance",
        "larger stated distances", "the usual level of 0.95")
    nu_gap_turn: float = _of(1.0, "rad", "Largest step of the phase that is trusted", "less safe winding numbers", _NUMERICAL)
    nu_gap_rounds: int = _of(14, "halvings", "Of the grid where the phase turns faster", "longer", _NUMERICAL)
    nu_gap_settled: float = _of(0.1, "half turns", "That the two ends may lack of a whole number",
        "less safe winding numbers", _NUMERICAL)
    nu_gap_beyond: float = _of(30.0, "upper band end", "To which the axis is followed", "longer", _NUMERICAL)

    @property
    def sizes(self) -> Mapping[str, Weighted]:
        """Priors of the likelihood's sizes, by the names of `likelihood.Sizes`."""
        return {
            "drift": self.likelihood_drift_sizes, "nominal": self.likelihood_nominal_sizes,
            "cause": self.likelihood_cause_sizes, "noise": self.likelihood_noise_factors, "within": self.likelihood_within_sizes,
            "parts": self.likelihood_parts_sizes, "losses": self.likelihood_losses_sizes,
            "flexibility": self.likelihood_flexibility_sizes,
        }

    @property
    def priors(self) -> Mapping[str, float]:
        """Prior of each kind of hypothesis."""
        return {"none": self.prior_none, "known": self.prior_known, "unknown": self.prior_unknown, "sums": self.prior_sums}
# fmt: on


SETTINGS = Settings()
"""The numbers that the diagnosis uses."""
