"""Numbers of judgement of the records, the likelihood and one fit."""

# ruff: noqa: RUF009 - the call makes a field
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.settings.field import JUDGEMENT, NUMERICAL, STATISTICS, TIME, Weighted, of
from cutvib_ss.measurement.levels import LEVELS_APART


# fmt: off
@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Of records and their bands, the likelihood, one fit, and its simulation."""

    # Records and their bands
    record_noisy: float = of(5.0, "1",
        "Noise, as a multiple of its level in the quiet part of the spectrum, where the band ends",
        "wider bands with noisier ends", JUDGEMENT)
    record_below_first_mode: float = of(0.6, "first natural frequency",
        "Where the band begins: below, accelerance drowns in drift", "narrower bands", JUDGEMENT)
    record_beyond_mode: float = of(1.2, "highest natural frequency of a structure's model",
        "Above which a resonance of the records is none of the model's", "fewer bands are cut",
        "stiffness off by 40 %, more than any tolerance, moves a mode so far")
    record_prominence: float = of(6.0, "dB", "Prominence of such a resonance", "fewer bands are cut",
        "an isolated mode of 10 % damping has 14 dB, a response between antiresonances hardly any")
    record_same_resonance: float = of(0.03, "relative", "By which it may differ between records", "chance peaks are taken for one",
        "drift moves frequencies by a percent at the most")
    record_below_resonance: float = of(1.1, "its frequency over the band's end", "Where the band ends below such a resonance",
        "narrower bands", "residual modes hold what it does there")
    record_median_lines: int = of(7, "lines", "Lines over whose median a response's power is compared with the noise",
        "narrow dips are kept", STATISTICS)
    record_lost: float = of(0.05, "1",
        "Error by the steps of a converter, over the response, from which a channel's lines are left out: "
        "it is alike in all lines of a mode and in all records, which the likelihood takes for told by each",
        "more lines, and more gaps that a converter made", JUDGEMENT)
    record_lost_over: float = of(20.0, "Hz", "Over which both are averaged", "-", "some widths of a resonance")
    record_stop_moves: float = of(0.02, "1",
        "Relative distance within which a resonance of the nominal model is looked for, where a converter's steps end its decay",
        "more lines count less", "some tolerances of a frequency")
    record_heard: float = of(4.0, "1",
        "Response power over noise power below which a line is left out: noise on the force biases the estimate",
        "fewer lines", JUDGEMENT)
    record_driven_bias: float = of(0.01, "part of the force's power",
        "That its noise may be, where a continuous recording's band ends: H1 is too small by as much", "more lines that are biased",
        "as a channel's calibration is known")
    record_quiet_lines: float = of(0.2, "of the lines",
        "That the signal of a continuous recording leaves to the force's noise at least",
        "fewer such recordings are known", "filters leave some tenths")
    record_even_noise: float = of(2.0, "power", "Of the most over the tenth least of these lines, up to which they show noise",
        "a signal that falls up to the Nyquist frequency passes for noise", "a signal of third order falls by four")
    record_most_bias: float = of(0.5, "1", "Part of the force's power that is its noise, up to which the bias of H1 is taken off",
        "noisier lines", "beyond it the line is left out as not heard")
    record_late_together: float = of(3.0, "std", "Of the mean of jittering delays, beyond which a channel is late besides",
        "more delays are taken for jitter", STATISTICS)
    record_late_passes: int = of(2, "passes", "In which records are moved by their mean delays", "longer", TIME)
    record_lasting: float = of(10.0, "squares of the noise",
        "Sum over all lines of what closed form and simulation of blows differ by, from which both are tried",
        "faster", "half of it is in nats what it may shift evidence by")
    record_least_noise: float = of(1e-4, "of the response",
        "Standard deviation below which none is believed that was read off how smooth a response is",
        "noise-free data are believed less", "force and response channels are linear to no better")
    record_swept: float = of(0.3, "blocks", "Part of a recording's blocks that share the force at a line, up to which "
        "no tones are looked for, since it is a sweep", "fewer tones are seen",
        "noise has a half, a sweep those blocks in which it passes the line")
    record_fewest_lines: int = of(8, "lines", "Lines that a record needs", "short records are refused",
        "a resonance has four unknowns, a complex line tells two; as many again judge the fit")
    record_blow_at: float = of(0.05, "s", "Assumed instant of a blow that no record states", "-", JUDGEMENT)
    record_blow_at_std: float = of(0.05, "s", "Prior standard deviation of that instant", "the instant is freer", JUDGEMENT)
    record_same_level: float = of(1.05, "1", "Ratio of levels up to which two records are repetitions",
        "more repetitions, and level dependence taken for scatter", "hands and shakers repeat a level to some percent")

    # Likelihood
    likelihood_drift_sizes: Weighted = of(
        ((3e-5, 0.10), (1e-4, 0.10), (3e-4, 0.15), (1e-3, 0.25), (3e-3, 0.25), (1e-2, 0.12), (3e-2, 0.03)),
        "relative std, probability", "Prior of the drift between sessions", "differences between sessions are forgiven",
        "machines repeat to 0.1-2 %, rarely worse")
    likelihood_within_sizes: Weighted = of(
        ((1e-6, 0.55), (3e-5, 0.05), (1e-4, 0.08), (3e-4, 0.12), (1e-3, 0.12), (3e-3, 0.06), (1e-2, 0.02)),
        "relative std, probability", "Prior of the drift from record to record within a session",
        "what differs between levels is forgiven", "machines warm and settle while they are struck, by less than overnight")
    likelihood_nominal_sizes: Weighted = of(
        ((3e-5, 0.15), (1e-4, 0.15), (3e-4, 0.20), (1e-3, 0.25), (3e-3, 0.15), (1e-2, 0.08), (3e-2, 0.02)),
        "relative std, probability", "Prior of the discrepancy of the nominal model's elements",
        "small causes are taken for model error",
        "finite elements and modal models of machined parts err by tenths of a percent in dynamic stiffness once tuned")
    likelihood_cause_sizes: Weighted = of(
        ((1e-3, 0.10), (3e-3, 0.15), (1e-2, 0.25), (3e-2, 0.30), (1e-1, 0.15), (3e-1, 0.05)), "relative std, probability",
        "Prior of the discrepancy of the cause itself", "causes of the wrong form are forgiven",
        "constitutive models of joints, contacts and losses hold to some percent, seldom to a tenth of that")
    likelihood_parts_sizes: Weighted = of(
        ((1e-3, 0.25), (1e-2, 0.15), (3e-2, 0.15), (0.1, 0.20), (0.3, 0.15), (1.0, 0.10)), "tolerances, probability",
        "Prior of errors of single parts of a structure's stiffness and mass", "causes at one place are taken for model error",
        "the tolerance of a matrix is that of all of it; parts differ among each other by less")
    likelihood_losses_sizes: Weighted = of(
        ((1e-3, 0.15), (3e-2, 0.15), (0.1, 0.20), (0.3, 0.25), (1.0, 0.20), (3.0, 0.05)), "tolerances, probability",
        "The same of the losses of single modes", "causes of damping are taken for model error",
        "measured modal dampings scatter by 20-50 % about any law, single ones by a factor of two")
    likelihood_flexibility_sizes: Weighted = of(
        ((1e-4, 0.30), (1e-3, 0.10), (1e-2, 0.20), (3e-2, 0.12), (0.1, 0.12), (0.3, 0.10), (1.0, 0.06)),
        "of what a port's mass gives way at such a mode's frequency, probability",
        "Prior of the flexibility of residual modes, which a structure's model leaves out",
        "causes that act above the band are taken for it",
        "a mode of a bar moves a part of what its mass does, one of a thousand parts a thousandth; some models hold all")
    likelihood_set_up_sizes: Weighted = of(
        ((1e-2, 0.35), (0.1, 0.15), (0.3, 0.20), (1.0, 0.20), (3.0, 0.10)), "of a set-up's units, probability",
        "Prior of set-up errors: position of the head; direction and point of the force",
        "set-up errors are taken for a gap", "axes return to 0.01 mm, a hand marks and aims to some mm and degrees")
    set_up_passes: int = of(4, "passes", "In which heads are placed where the best linear cause finds them",
        "slower", "errors of 10 mm, as large as any of a hand, take three")
    set_up_position: float = of(1e-3, "m", "Unit of the position error", "only the unit of its size", "definition")
    set_up_point: float = of(1e-3, "m", "Unit of the force's offset from its point", "only the unit", "definition")
    set_up_shared: float = of(3.3, "std", "From which the mean of set-up errors is an error that all share", "shared errors hide",
        "of a thousand campaigns without one such a mean is seen in one")
    set_up_angle: float = of(1e-2, "rad", "Unit of the force's tilt", "tilt weighs more against offset",
        "a hand that aims to a millimetre at an arm of 0.1 m aims to a hundredth of a radian")
    likelihood_residual_modes: tuple[float, ...] = of((1.05, 1.15, 1.4, 2.0, 4.0), "highest natural frequency or line",
        "Frequencies of residual modes", "nothing close above the band is held",
        "distances grow in proportion: any modes above the first are held to some percent of what they do")
    likelihood_noise_factors: Weighted = of(
        ((0.1, 0.005), (0.3, 0.02), (0.7, 0.075), (1.0, 0.65), (1.3, 0.18), (2.0, 0.055), (4.0, 0.01), (10.0, 0.004),
         (100.0, 0.001)),
        "factor on the variance, probability", "Prior of the noise against its estimate", "residuals are taken for noise",
        "estimates from 5-20 repetitions; on a machine that is not linear part of what scatters is its own doing")
    likelihood_noise_unknown: Weighted = of(tuple((float(v), 1.0 / 13.0) for v in np.geomspace(1.0, 1e6, 13)),
        "factor on the variance, probability", "The same where no repetitions told the scatter",
        "residuals are taken for noise", "the noise is then a guess")
    likelihood_most_lags: int = of(60, "lines", "Lags over which residuals are correlated at most",
        "long correlations are seen", TIME)
    likelihood_correlated: float = of(0.1, "1", "Correlation of neighbouring residuals that stands out",
        "less correlation is counted", "twice the scatter of 400 lines")
    likelihood_precision_floor: float = of(1e-9, "1", "Added precision that keeps a normal matrix regular", "-", NUMERICAL)
    likelihood_farthest_drift: float = of(6.0, "std", "How far a session may drift", "outlying sessions are followed",
        STATISTICS)
    discrepancy_length: float = of(0.6, "ln(frequency)", "Correlation length of a discrepancy over frequency",
        "smoother discrepancies", "it may change within most of an octave")
    discrepancy_amplitude_length: float = of(1.0, "ln(amplitude)",
        "The same of a restoring force over the amplitude of its motion", "smoother discrepancies",
        "as over frequency, wider since amplitude spans decades")
    discrepancy_amplitudes: int = of(4, "amplitudes",
        "About which a restoring force's form may err, from the largest motion downwards", "errors at smaller amplitudes",
        "two decades, in which a response decays to its noise")
    discrepancy_position_length: float = of(0.3, "rail length", "The same of a cause along the rail over the head's position",
        "smoother discrepancies", "mode shapes of the first two bending or torsional modes differ so by their end conditions")
    discrepancy_modes_drift: float = of(0.5, "drift of a stiffness",
        "By how much a mode of a structure drifts by itself, beside what moves all modes", "sessions may differ in single modes",
        "springs of chains of three to six that drift one by one: 0.41 to 0.46, and pairs of modes 0.36 to 0.49")
    discrepancy_least_variance: float = of(1e-3, "1", "Relative variance below which a shape of the process is dropped",
        "fewer shapes", NUMERICAL)
    discrepancy_points: int = of(25, "points", "Points of a record that stand for the process behind a cause's discrepancy",
        "longer", TIME)
    discrepancy_variance_left: float = of(0.02, "1", "Variance that its pivots may leave", "fewer pivots", NUMERICAL)
    discrepancy_most_pivots: int = of(40, "pivots", "Number of its pivots at most", "longer", TIME)
    calibration_shapes: int = of(8, "shapes",
        "Polynomials that a calibration error is made of: what a first-order corner or a resonance outside of the band leaves of "
        "1 % is 0.01 %",
        "errors that vary faster over the band", JUDGEMENT)
    predictive_small_drift: float = of(1e-4, "relative std", "Drift that moves a response in proportion", "fewer iterations",
        NUMERICAL)
    predictive_iterations: int = of(12, "iterations", "In which a larger drift of a held-out session or record is found, at most",
        "longer", NUMERICAL)
    predictive_gain: float = of(1e-3, "relative", "Gain of an iteration below which it is the last", "larger errors of the drift",
        NUMERICAL)

    # One fit
    fit_tuned_away: float = of(3.0, "tolerances",
        "By which a tuned value is off where causes that move it are fitted in any case, and all by their root mean square where "
        "the answer is not sure", "longer; more such answers are sure",
        "one of 370 right models has a given value that far out")
    fit_strained: float = of(5.0, "tolerances",
        "Of a tuned value beside a restoring force or no cause, from which another cause stands behind it",
        "second causes are rarer",
        "one normal value in a million; tolerances are stated roughly, and right restoring forces were seen with 4")
    fit_gain: float = of(0.1, "objective", "Gain at which steps end", "coarser fits",
        "a twentieth of what tells two causes apart by a factor of e")
    fit_rough_gain: float = of(1e-3, "of all gained before", "Gain at which steps end where records are simulated or drift "
        "by themselves", "rougher", TIME)
    fit_passes: int = of(3, "climbs", "Times that a fit climbs at most", "longer", TIME)
    fit_damping: float = of(1e-3, "curvature", "Damping at which steps begin, and from which one that gains nothing is damped more",
        "smaller first steps", NUMERICAL)
    fit_promise: float = of(0.1, "needed gain", "That a whole step has to promise to be tried",
        "starts far from the truth are given up", TIME)
    fit_trail: int = of(3, "steps", "By which the next one is extrapolated", "longer memory", NUMERICAL)
    fit_curvature: float = of(1e-4, "1", "Relative error of an element that moves derivatives: a hundredth of a small loss factor",
                          "longer", NUMERICAL)
    fit_difference: float = of(1e-5, "stiffness", "Relative difference by which second derivatives are taken", "-", NUMERICAL)
    fit_scout_steps: int = of(10, "steps", "A fit of no more steps climbs once", "more scouts", TIME)
    fit_start_lines: int = of(120, "lines", "Lines on which drifting sessions are started", "longer", TIME)
    fit_fewer_lines: int = of(300, "lines", "Of a record, on which a linear cause is fitted before all are taken", "longer", TIME)
    fit_start_error: float = of(0.1, "1", "Relative error added to those", "smoother objective", JUDGEMENT)
    fit_start_gain: float = of(1e-2, "1", "Relative gain at which those steps end", "rougher starts", TIME)
    fit_looked_through: float = of(3.0, "tolerances",
        "To either side, in which the stiffness of a structure is looked through for a start", "longer", STATISTICS)
    fit_looked_step: float = of(0.5, "width of the narrowest resonance", "By which a frequency moves from one to the next",
        "the right one may lie between", NUMERICAL)
    fit_looked_most: int = of(60, "stiffnesses", "To either side, at most", "longer", TIME)
    fit_instants: int = of(4, "1", "Instants of the blow that are tried within a period of the slowest mode, to either side",
        "longer", "a start within a sixth of a period leads to the optimum")
    fit_hopeless: float = of(5.0, "χ² per datum", "From which a fit is not worth small steps", "longer", TIME)
    fit_hopeless_gain: float = of(1e-3, "1", "Relative gain at which such a fit ends", "rougher", TIME)
    fit_run_away: float = of(1e16, "χ² per datum", "From which a model has run away", "-", NUMERICAL)
    fit_most_damping: float = of(0.9, "1", "Damping ratio of the rail beyond which none is followed", "-", NUMERICAL)
    fit_within: float = of(8.0, "std", "How far a tuned value or calibration error is followed", "-",
        "its prior holds it long before")
    projection_step: float = of(0.05, "std", "Step of tuning and shape in a difference of two closed forms", "-", NUMERICAL)
    projection_shape_steps: float = of(40.0, "1", "Range of a shape over its unit", "smaller units", NUMERICAL)
    projection_tries: int = of(8, "dampings", "Tried for a step", "longer", NUMERICAL)
    projection_gain: float = of(1e-2, "1", "Relative gain at which its steps end", "rougher", TIME)
    tail_died_out: float = of(-10.0, "Re(s)·T", "Below which a mode leaves nothing at the block's end: 5e-5 of itself",
        "fewer modes in the tail", NUMERICAL)
    tail_widened: float = of(-4.0, "Re(s)·T", "The same beside a noise widened to some percent: 2 % of itself",
        "fewer modes in the tail", TIME)
    tail_force: float = of(1e-3, "peak force", "Below which a sample of a blow is no part of it", "shorter blows",
        "sensor noise between blows would ring in the tail")
    tail_force_noise: float = of(0.02, "peak force", "Most that is taken for noise of the force", "shorter blows",
        "a push may fill its record; noisier blows only take longer")
    leakage_poles: float = of(1.5, "band end", "Up to which poles of a model leak", "more poles",
        "beyond, what a block's window spreads of them is smooth over the band")
    leakage_alike: float = of(1e-9, "1", "Below which parts of a change are told from no other", "-", NUMERICAL)
    tail_points: int = of(16, "points", "On each circle around a pole: with the radius, 0.4^16 = 4e-7 of the tail", "longer",
        NUMERICAL)
    tail_points_widened: int = of(8, "points", "The same beside a noise widened to some percent: 7e-4 of the tail", "longer",
        TIME)
    tail_radius: float = of(0.4, "distance",
        "Radius of each circle, of its pole's distance from the line s = σ + jω and other poles", "less accurate", NUMERICAL)

    # Simulation of causes that depend on the level
    simulation_tuning_step: float = of(0.02, "std", "Step of a tuned value in a difference of two closed forms", "-",
        NUMERICAL)
    simulation_law_step: float = of(2e-4, "range", "Step of a restoring force's parameter in a difference of two simulations", "-",
        NUMERICAL)
    simulation_linear_step: float = of(2e-6, "range", "The same of a linear cause's, which moves it smoothly", "-",
        NUMERICAL)
    simulation_blow_steps: tuple[float, float] = of((0.2, 6e-3), "std and range",
        "The same two in blows where something touches, and on all lines of any restoring force: contact begins and ends, and "
        "friction turns, between samples, and what that rounds of a single motion is as much as a smaller step changes it",
        "rougher derivatives", NUMERICAL)
    simulation_harmonics: int = of(3, "harmonics", "Balanced in sine sweeps; the first is compared", "longer", NUMERICAL)
    simulation_force_scale: float = of(0.2, "1", "Relative error of a force that no record holds",
        "looser fits of such records", "hands scatter, and the blow's length is a guess")
    simulation_force_scale_step: float = of(0.02, "std", "Its step in a difference of two simulations", "-", NUMERICAL)
    simulation_form_step: float = of(0.1, "describing function",
        "Error of a restoring force's form in a difference of two simulations: where a force jumps, its instants round", "-",
        NUMERICAL)
    simulation_force_offset: float = of(0.1, "rms force",
        "Standard deviation of a constant force beside that of a continuous recording", "friction and clearance fit more",
        "weights, cables and amplifiers' zeros are some percent of what excites")
    simulation_early_jump: float = of(0.5, "1",
        "Part of the lines between two folds by which a sweep may jump before the one to which it goes, which is the nearer then",
        "less is learnt from where a sweep jumps", JUDGEMENT)
    simulation_late_jump: float = of(0.25, "1",
        "Part of the lines between two folds by which a measured jump may lie behind the model's",
        "less is learnt from where a sweep jumps", JUDGEMENT)
    simulation_branches_apart: float = of(1e-3, "1",
        "Difference of two branches, of the largest response, from which a line lies between folds", "-", NUMERICAL)
    simulation_static_above: float = of(5.0, "band", "Modes so far above the band yield statically to nonlinear forces",
        "longer", NUMERICAL)
    simulation_classical_above: float = of(20.0, "band", "Damping couples no mode so far above the band", "longer", NUMERICAL)
    simulation_steps: float = of(20.0, "steps a period",
        "On all lines: χ² errs by 1e-6 of a degree of freedom for smooth forces, 3e-4 for friction, which takes twice as many",
        "longer", NUMERICAL)
    simulation_rough_steps: float = of(10.0, "steps a period", "The same on few lines: 1e-3 and 1e-2", "longer", NUMERICAL)
    simulation_hysteresis_at: float = of(100.0, "Hz", "Where hysteretic damping is made viscous for stepping in time", "-",
        "the first modes of machines of this size")
    level_blows: int = of(3, "blows", "Of a record that are compared one by one", "fewer such comparisons",
        "a mean, what orders with the force, and one to judge it by")
    level_drift: float = of(0.05, "probability",
        "Of drift that orders with the level by chance as much as it does, from which restoring forces are looked for all the same",
        "more searches in vain", TIME)
    level_hiding_drift: float = of(3e-3, "relative std", "Of drift between sessions of a level each, from which it may hide a "
        "restoring force, and these are looked for", "fewer searches", "machines repeat to 0.1-0.3 % in most cases")
    level_hiding_within: float = of(1e-3, "relative std", "The same of drift from record to record within sessions",
        "more answers of something unknown beside drift", "what moves resonances by less changes no machine")
    level_trend: float = of(0.25, "probability",
        "That drift within sessions is a trend in time and goes with the level, since all were measured in its order",
        "surer linear answers", "half of all drift is warming; of two orders of the levels half are the same in all sessions")
    level_ordered: float = of(0.01, "probability",
        "Of blows that order with their force by chance as much as they do, from which it is nonlinearity",
        "more records are called nonlinear", STATISTICS)
    comparison_common_lines: int = of(8, "lines", "That two records must share to be compared", "fewer comparisons",
        JUDGEMENT)
    comparison_same_line: float = of(1e-3, "spacing", "Within which two lines are the same", "-", NUMERICAL)
    comparison_halved: float = of(4.0, "1",
        "By how much a cubic spline's error grows with twice the spacing, at least: by 16 where lines are dense, by less on a peak",
        "interpolated records are trusted more", JUDGEMENT)
    comparison_neighbours: int = of(9, "lines", "Of which the largest such error is taken",
        "interpolated records are trusted less", JUDGEMENT)
    comparison_tail_error: float = of(0.3, "1", "Relative error of what unlike blocks cut off, where a model tells it",
        "less weight on cut responses", JUDGEMENT)
    level_lines: int = of(24, "lines", "Over which the scatter between levels is averaged",
        "narrow effects of the level are missed", STATISTICS)
    level_stands_out: float = of(5.0, "std", "By which that has to exceed one, somewhere", "less level dependence is seen",
        STATISTICS)
    level_noise_error: float = of(0.15, "1", "Added to it, for the noise itself is an estimate",
        "less level dependence is seen", STATISTICS)
    level_apart: float = of(LEVELS_APART, "1", "Ratio of levels from which a level-dependent response would show",
        "fewer campaigns compare levels", JUDGEMENT)
    level_excess: float = of(1.15, "χ² per datum", "Between levels, from which a response is called level-dependent",
        "less level dependence is reported", STATISTICS)
# fmt: on
