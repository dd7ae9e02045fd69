"""Numbers of judgement of what is concluded from the fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.settings.field import JUDGEMENT, NUMERICAL, SIMULATED, STATISTICS, TIME, of


# fmt: off
@dataclass(frozen=True, kw_only=True)
class AnswerSettings:
    """Of priors and the verdict, the place, error bands, limits, plans and consequences."""

    # Priors and the verdict
    prior_none: float = of(0.5, "probability", "Prior of no cause", "more 'no_gap'",
        "a machine is measured because somebody doubts its model, but most parts of it are right")
    prior_known: float = of(0.3, "probability", "Prior of one known cause, shared by all", "more 'explained'", "as above")
    prior_unknown: float = of(0.1, "probability", "Prior of an unknown element, shared by all ports", "more 'unknown'",
        "as above")
    prior_sums: float = of(0.1, "probability", "Prior of two causes together", "more pairs", "as above")
    unknown_knots: int = of(9, "knots", "Knots of an unknown element over the band", "finer functions",
        "two to three an octave and a half, as its correlation length asks")
    unknown_amplitudes: tuple[float, ...] = of((0.03, 0.3, 3.0), "stiffness of the port at mid band",
        "Standard deviations of an unknown element; each has an equal share of the prior", "larger elements", JUDGEMENT)
    unknown_poles: int = of(2, "pairs", "Of poles beside an unknown element at a port, at most", "longer",
        "a smooth function holds no resonance, and two in one part are a rarity")
    unknown_pole_starts: int = of(46, "frequencies", "Over the band, at which they are tried", "longer",
        "as those of a local resonator")
    unknown_channel: float = of(3.0, "calibration tolerance",
        "Smallest standard deviation of the error of a channel; the others stand to it as those of an element", "larger errors",
        "an error within the stated tolerance is no cause; of a thousand channels three err by more than three of it")
    unknown_stations: tuple[float, ...] = of((0.2, 0.35, 0.5, 0.65, 0.8), "y/L",
        "Points from which an unknown element moves along the rail",
        "more starts", "a start at midspan ends at the mirror image of a point between; half a wave of the third mode apart")
    unknown_level_spacing: float = of(0.8, "ln(amplitude)",
        "Spacing of the knots of an unknown restoring force over the level of the motion", "coarser functions",
        "somewhat below its correlation length")
    unknown_farthest: float = of(50.0, "std", "How far its coefficients are followed", "-", NUMERICAL)
    verdict_sure: float = of(0.9, "probability", "From which a cause is named", "fewer named causes, fewer of them wrong",
        "one in ten of what is called sure may be wrong")
    verdict_set: float = of(0.95, "probability", "That the ambiguity set and the set of places carry", "larger sets",
        "the usual level of a credible set")
    verdict_half: float = of(0.5, "probability", "From which no cause, or an unknown one, is the verdict",
        "fewer such verdicts", "more probable than not")
    verdict_noise: float = of(1.1, "χ² per datum", "On held-out records, up to which a second cause counts as known",
        "second causes are believed that leave more", "as search_enough")
    verdict_misfit: float = of(2.0, "χ² per datum",
        "On held-out records, from which the re-tuned model is no answer, a cause not sure, and a restoring force not enough",
        "more gaps are called none, fewer pairs", "noise estimated from a few blows is right to a factor below two")
    verdict_closed: float = of(0.97, "excess", "That a cause alone has to close to be the answer where no second one is known",
        "more answers say that something is left", "restoring forces and supports hold to ten or twenty percent: squared, a few")
    verdict_size: float = of(1.96, "standard deviations", "That a cause's size has to lie from nothing", "fewer causes are named",
        "a normal posterior's 95 % interval holds nothing below")
    verdict_form: float = of(0.6, "probability",
        "That an answer keeps whose model errs by more than is believed, by a parameter, its discrepancies or on held-out records, "
        "and an unknown element, which may be a known cause in another form",
        "more such answers are sure",
        "a right model needs both in one campaign of a thousand, by their priors; the rest is judgement")
    verdict_hardly: float = of(0.01, "probability", "Below which a cause is not looked at again", "longer", TIME)
    verdict_judged: int = of(3, "causes", "Causes judged on held-out records while they carry any probability", "longer",
        TIME)

    # The place, and unknown dynamic stiffness
    place_lines: int = of(60, "lines", "Of a group, on which places are compared", "longer", TIME)
    place_climbed: int = of(2, "variants", "Of each place, fitted with all steps", "longer", TIME)
    place_climbs: int = of(4, "steps", "Of the tuning", "longer", TIME)
    place_disturbed: float = of(0.95, "probability",
        "Of the measurement, where tones or trigger jitter disturb it and nothing else is at fault", "-", JUDGEMENT)
    place_far: float = of(10.0, "mean square",
        "Left by a variant after its first step, over the least of any, from which it takes no more", "longer",
        "further steps took away less than half of it, of restoring forces in simulated machines")
    place_folds: int = of(3, "folds", "In which positions are left out", "longer", STATISTICS)
    place_sharpness: float = of(0.2, "1", "Weight of a datum's evidence: lines of one resonance repeat each other",
        "surer places", SIMULATED + ", one in three of a restoring force outside the catalogue")
    place_doubt: float = of(0.01, "probability", "Spread evenly over all places", "less sure places", "as place_sharpness")
    place_held_out: float = of(0.25, "1", "Weight of the residual at held-out positions, against that at all",
        "places that predict other positions gain", JUDGEMENT)
    place_smooth: float = of(0.5, "1", "Weight of what smooth functions leave where every record has its own",
        "places of smooth functions gain", JUDGEMENT)
    place_by_record: float = of(2 / 3, "1", "Weight of that view, against functions by level", "-", JUDGEMENT)
    place_shown: float = of(0.05, "probability", "From which a place's functions are kept", "fewer", "size of the result")
    place_most_shown: int = of(2, "places", "Whose functions are kept at most", "more", "size of the result")
    stiffness_model_error: float = of(0.01, "1", "Relative error of a response that no parameter explains",
        "smoother functions", JUDGEMENT)
    stiffness_tail_error: float = of(0.3, "1", "Relative error of what the blocks cut off", "less weight on cut responses",
        "that is taken from the model without the elements")
    stiffness_steps: int = of(10, "steps", "From afar, at most", "longer", TIME)
    stiffness_steps_nearby: int = of(4, "steps", "From close by, at most", "longer", TIME)
    stiffness_gain: float = of(1e-3, "1", "Relative gain at which they end", "rougher", TIME)
    stiffness_degree: int = of(10, "degree", "Of a smooth function of ln(frequency)", "rougher functions", JUDGEMENT)
    stiffness_reweighted: int = of(8, "times", "That lines far from it are given less weight", "longer", NUMERICAL)
    type_explains: float = of(0.9, "1", "Part of a function's weighted squares that a named type explains",
        "fewer are named", JUDGEMENT)
    type_simpler: float = of(0.5, "1", "Residual of a type of more parameters, over a simpler one's",
        "richer types are named", JUDGEMENT)
    type_floor: float = of(0.02, "1", "Relative error that no type is asked to beat", "simpler types are named",
        "as stiffness_model_error")
    type_resonances: int = of(60, "frequencies", "Tried for a sprung mass", "longer", NUMERICAL)
    type_dampings: tuple[float, ...] = of((0.005, 0.01, 0.02, 0.05, 0.1), "1", "Damping ratios tried with each", "-",
        NUMERICAL)
    type_powers: tuple[float, ...] = of(tuple(p for p in np.linspace(-3.0, 3.0, 61).round(1).tolist() if p != 0.0), "1",
        "Powers of the level that are tried", "-", NUMERICAL)
    type_changes: float = of(0.15, "1", "Relative change over the levels below which a function does not depend on them",
        "fewer depend on the level", JUDGEMENT)
    faults_end_stiffness: float = of(30.0, "first mode's stiffness", "Of the ends against which they are freed", "-",
        "any would do")
    faults_twist: float = of(50.0, "first bending frequency",
        "First frequency of the twist against which the rail's is freed", "-", "any far above the band would do")

    # Error bands
    band_stands_out: float = of(4.0, "std", "By which a band's mean square exceeds that of noise", "fewer bands",
        STATISTICS)
    band_width: float = of(5.0, "Hz", "Over which the error is averaged to find them", "weaker and wider bands", JUDGEMENT)
    band_main_share: float = of(0.8, "1", "Part of the error above the noise that the main bands hold", "more bands",
        JUDGEMENT)
    band_smooth: float = of(4.0, "Hz", "Over which the error is averaged, and below which a gap is closed",
        "fewer, wider bands", JUDGEMENT)
    band_narrow: int = of(3, "lines", "That a band has to hold to be shown", "fewer bands", STATISTICS)
    band_moves: float = of(1e-3, "probability", "Of centres that spread as much without moving",
        "more bands are said to move", STATISTICS)

    # Limits, information and plans
    limits_lines: int = of(120, "lines", "Of a record on which limits are computed, about", "longer", TIME)
    limits_shapes: int = of(3, "shapes", "Of a cause that are tried: the first, the middle, the last", "longer", TIME)
    limits_tail: float = of(0.05, "probability", "Beyond the bound", "tighter bounds",
        "the usual level of a one-sided bound")
    limits_farthest: float = of(-6.0, "std",
        "Below zero, beyond which an estimate tells of wrong noise, not of a tighter bound", "-", STATISTICS)
    limits_small: float = of(1e-4, "χ²", "Change at which the derivative is taken: 0.01 standard deviations", "less linear",
        NUMERICAL)
    limits_iterations: int = of(20, "iterations", "Of the visible size, which changes with a logarithm of itself", "longer",
        NUMERICAL)
    seen_small: float = of(2e-4, "peak", "Change of a response that is in proportion to the severity", "-", NUMERICAL)
    seen_small_law: float = of(0.01, "peak", "The same of a simulated one, whose steps leave something", "-", NUMERICAL)
    seen_steps: int = of(4, "steps", "To that change", "longer", NUMERICAL)
    seen_smooth: float = of(20.0, "Hz", "Over which the relative error of a response is one and the same",
        "less is told apart", JUDGEMENT)
    plan_lines: int = of(250, "lines", "On which a planned campaign is computed; each stands for several", "longer", TIME)
    plan_odds: float = of(19.0, "odds", "At which a cause is told from its rival: 0.95", "larger severities are asked",
        "as verdict_set")
    plan_blow_at: float = of(0.02, "s", "Instant of the blow in its block", "-", "a usual pretrigger")
    next_positions: int = of(24, "positions", "Tried for the next test", "longer", TIME)
    next_positions_laws: int = of(8, "positions", "The same where causes have to be simulated", "longer", TIME)
    next_ends: tuple[float, float] = of((0.04, 0.96), "y_b / L", "First and last of them", "-", "the head stays on the rail")
    next_levels: tuple[float, ...] = of((1 / 3, 1.0, 3.0), "level measured", "Levels that are tried where there was but one",
        "-", "half a decade either way")
    next_lines: int = of(150, "lines", "On which causes are simulated", "longer", TIME)

    # What a cause changes
    consequence_draws: int = of(200, "draws", "From the covariance", "longer", STATISTICS)
    consequence_draws_laws: int = of(24, "draws", "The same of causes that depend on the level", "longer", TIME)
    consequence_positions: int = of(6, "positions", "Shown at most", "longer", "size of the result")
    consequence_positions_laws: int = of(3, "positions", "The same of causes that depend on the level", "longer", TIME)
    consequence_modes: int = of(8, "modes", "Of the rail on which a controller is checked, at least", "longer", NUMERICAL)
    metric_lines: int = of(5, "lines",
        "Over which a measured chordal distance is averaged: noise alone lies anywhere on the sphere",
        "narrow differences are missed", STATISTICS)
    metric_one_in: float = of(20.0, "records", "In one of which noise exceeds its stated distance",
        "larger stated distances", "the usual level of 0.95")
    nu_gap_turn: float = of(1.0, "rad", "Largest step of the phase that is trusted", "less safe winding numbers", NUMERICAL)
    nu_gap_rounds: int = of(14, "halvings", "Of the grid where the phase turns faster", "longer", NUMERICAL)
    nu_gap_settled: float = of(0.1, "half turns", "That the two ends may lack of a whole number",
        "less safe winding numbers", NUMERICAL)
    nu_gap_beyond: float = of(30.0, "upper band end", "To which the axis is followed", "longer", NUMERICAL)
# fmt: on
