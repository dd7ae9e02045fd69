"""Numbers of judgement of the search for a cause."""

from __future__ import annotations

from dataclasses import dataclass

from cutvib_ss.diagnosis.settings.field import JUDGEMENT, NUMERICAL, STATISTICS, TIME, of


# fmt: off
@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """Of the search, and of records that were held out."""

    # Search
    search_work: float = of(1.5e9, "derivatives", "Of values of a response, or what takes as long, after which further "
        "steps are left out", "longer", TIME)
    search_work_pairs: float = of(1.5, "1", "Of `search_work`, after which causes that act together are left out", "longer", TIME)
    search_response: float = of(6.0, "derivatives", "What a value of a response counts as, by the time it takes", "-", TIME)
    search_sample: float = of(11.0, "derivatives", "The same of a sample that is simulated", "-", TIME)
    search_products: float = of(0.6, "derivatives", "The same of a derivative in the normal matrix and its factors", "-", TIME)
    search_small_order: int = of(8, "degrees of freedom", "Coupled ones beyond which work counts by their number", "-",
        TIME)
    search_coarse_lines: int = of(120, "lines", "Of a group, on which starts are fitted", "longer", TIME)
    search_coarse_error: float = of(0.03, "1", "Relative error by which their noise is widened",
        "weak causes are passed over", JUDGEMENT)
    search_coarse_gain: float = of(1e-2, "1", "Relative gain at which their steps end", "rougher", TIME)
    search_outlook_positions: int = of(3, "positions", "On which starts of level-dependent causes are fitted", "longer",
        TIME)
    search_outlook_blocks: int = of(2, "blocks", "Of a continuous recording on which they are", "longer", TIME)
    search_close: float = of(60.0, "objective", "Behind the best on few lines, up to which a cause is fitted on all",
        "longer", TIME)
    search_most_close: int = of(5, "causes", "So fitted at most: where many are alike, none of them is the cause", "longer",
        TIME)
    search_far: float = of(400.0, "objective", "Behind the best, from which no cause is fitted on all lines", "longer",
        TIME)
    search_start_steps: int = of(3, "steps", "From each start", "longer", TIME)
    search_starts_climbed: int = of(3, "starts", "Of a cause from which steps are taken", "longer", TIME)
    search_starts_most: int = of(8, "starts", "The same while they leave more than the widened noise", "longer", TIME)
    search_later_steps: int = of(10, "steps", "On few lines, from the best start of a cause", "longer", TIME)
    search_law_steps: int = of(6, "steps", "The same of a restoring force", "longer", TIME)
    search_instants: int = of(2, "1", "The same as `fit_instants`, with the discrepancy, of the best fit", "longer", TIME)
    search_most_steps: int = of(40, "steps", "On all lines", "longer", TIME)
    search_most_law_steps: int = of(15, "steps", "The same of a restoring force: the last of many gain little", "longer", TIME)
    search_first_order: float = of(20.0, "χ² per datum",
        "Of the tuned model, from which all linear causes are fitted, since what one would take away to first order says little",
        "faster", JUDGEMENT)
    search_moving: int = of(3, "causes", "Of the best linear causes that are fitted to every record by itself", "longer", TIME)
    search_scouted: int = of(9, "causes",
        "Linear causes that promise most from the tuned model, and as many from the untuned one, that are fitted",
        "longer", "the true cause was within the first three of one or the other of 16 simulated machines, but for one")
    search_parts_leading: int = of(2, "causes", "That lead beside errors of a structure's parts, fitted on all lines too",
        "longer", TIME)
    search_linear_refined: int = of(3, "causes", "Linear causes fitted on all lines, at least", "longer", TIME)
    search_laws_refined: int = of(3, "causes", "Simulated causes fitted on all lines, at most", "longer", TIME)
    search_laws_looked_at: int = of(6, "causes", "Simulated causes whose scan is refined: the most promising", "longer",
        TIME)
    search_laws_started: int = of(3, "causes", "Of these, fitted on few lines", "longer", TIME)
    search_unknown_climbed: int = of(8, "elements", "Of unknown form that lead after their first steps, and take more", "longer",
        TIME)
    search_unknown_refined: int = of(3, "elements",
        "Sites of unknown elements, alone and beside a cause, that are given their own amplitude", "longer", TIME)
    search_hopeless: float = of(3.0, "χ² per datum", "On few lines, from which a simulated cause is not fitted on all",
        "longer", TIME)
    search_enough: float = of(1.1, "χ² per datum", "Below which the re-tuned model needs no cause if the level shows nothing",
        "small gaps are not searched", "five standard deviations of χ² of 5000 data")
    search_small: float = of(2.0, "χ² per datum",
        "Below which restoring forces are looked for beside the tuned model, as measured, not from afar", "more from beside",
        "the residual is less than the noise itself")
    search_caught: float = of(5.0, "log evidence",
        "Lead of a cause from which there is a gap, and the model without one is tuned again from there",
        "local minima of the re-tuned model stay; small gaps are not searched", "a factor of 150")
    search_left: float = of(1.05, "χ² per datum", "Below which nothing is tried beside the best cause", "fewer pairs", TIME)
    search_left_of_gap: float = of(2e-4, "gap", "Added to it", "fewer pairs", TIME)
    search_leads: float = of(0.1, "excess", "That a single cause has to take away before a second is tried on top",
        "fewer pairs", "else neither is known")
    search_by_law: float = of(0.5, "excess", "Of the best linear cause, that a restoring force takes away where the level stands "
        "out, from which elements that are the same at all levels are looked for no more", "longer", TIME)
    search_level_change: float = of(1e-3, "of the dynamic stiffness",
        "By which a restoring force has to differ between amplitudes, to be one", "fewer restoring forces",
        "that of rounding, and some")
    search_least_amplitude: float = of(0.01, "of the largest", "Amplitude with which that is compared", "the same", JUDGEMENT)
    search_odd: float = of(10.0, "χ² per datum", "Of one channel of a record under what leaves no more than noise of all others: "
        "from there it is left out", "fewer records are left out", "friction that shows that much in one shows in its neighbours")
    search_stray: float = of(6.0, "std", "Of the drift within sessions, from which a record is held against the others alone",
        "wrong records are left in", "a normal number is so far off with a probability of two in a thousand million")
    search_odd_share: float = of(0.125, "records", "That are left out, at most", "more records may be left out",
        "what shows in more of them may be the machine")
    scan_records: int = of(5, "records", "Up to which all are scanned", "longer", TIME)
    scan_steps: int = of(10, "steps", "Of the fit underneath a scan", "longer", TIME)
    scan_gain: float = of(1e-2, "1", "Relative gain at which they end", "rougher", TIME)
    scan_nudge: float = of(0.02, "range", "By which a parameter is moved off a start that does nothing", "-", NUMERICAL)
    scan_nothing: float = of(1e-3, "squares a datum", "Below which a start does nothing", "weak starts are moved",
        "so much the estimator's own sums may differ")
    scan_simplex: float = of(0.05, "range", "Size of the simplex from which a restoring force's best values are refined", "-",
        NUMERICAL)
    scan_evaluations: int = of(12, "evaluations a parameter", "In which they are", "longer", TIME)
    scan_shapes: int = of(5, "shapes", "Of a restoring force that are scanned in proportion to its strength", "longer", TIME)
    scan_in_proportion: float = of(0.01, "χ² per datum", "Up to which a restoring force changes in proportion to its strength",
        "steps from afar", NUMERICAL)
    scan_weaker: int = of(4, "tries", "In which such a strength is found", "longer", TIME)
    scan_extrapolated: float = of(4.0, "weakest start", "Up to which a force in proportion to its parameter is scaled", "-",
        NUMERICAL)
    pairs_astray: float = of(10.0, "χ² per datum", "On few lines, from which no restoring force is looked for in pairs", "longer",
        TIME)
    pairs_close: float = of(15.0, "objective", "As search_close, of pairs", "longer", TIME)
    pairs_first: int = of(2, "causes", "Single causes to which a second one is added", "longer", TIME)
    pairs_seconds: int = of(9, "causes", "Second causes fitted on each", "longer", TIME)
    pairs_law_seconds: int = of(3, "causes", "The same where one of the two is simulated", "longer", TIME)

    # Held-out records
    held_out_steps: int = of(5, "steps", "Of a fit on some records from the fit on all", "longer",
        "that lies within its own uncertainty of it")
    held_out_gain: float = of(1e-4, "1", "Relative gain of the objective at which those steps end", "rougher", TIME)
    held_out_law_steps: int = of(3, "steps", "The same of a restoring force", "longer", TIME)
    held_out_force_steps: int = of(3, "steps", "To the force scale of a held-out record whose force is guessed", "longer",
        NUMERICAL)
    held_out_blows_differ: float = of(0.5, "std", "By which force scales of its single blows may differ from their mean",
        "scattered blows are judged", JUDGEMENT)
    held_out_length_differs: float = of(0.1, "1", "Relative difference of a blow's length from its guess",
        "wrong guesses are judged", JUDGEMENT)
    held_out_bootstraps: int = of(2000, "draws", "Resamplings of the records behind an interval", "longer", STATISTICS)
# fmt: on
