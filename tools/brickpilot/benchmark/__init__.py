"""Benchmarks: how often discovery is right, how fast the simulator is, and what a control step costs on the RCX.

`brickpilot benchmark discover` and `tune-peer`, on data sets whose truth is known:

    sets.py            the data sets: `tests/hidden` makes them, or they exist already
    blind_test.py      runs discovery on each set and appends a result
    result.py          one result, a line of results.jsonl: truth and verdict
    score.py           what one result counts
    law_score.py       what one of a quick suite counts: by mechanism, law and place
    claims.py          what discovery is asked to show, as shares and figures over many results
    law_claims.py      the same for the quick suites, each apart
    table.py           the whole table; table_text.py prints it
    feedforward_fit.py the peer for real logs: kS, kV, kA and delays, fitted by free-run simulation
    sindy.py           the peer: PySINDy on the same sets, with a named library
    sindy_rows.py      the rows of its regression
    sindy_library.py   the columns of its regression: effects as text books write them
    sindy_motion.py    what the library is computed from
    sindy_tune.py      tunes its windows and gates on calibration seeds

`brickpilot benchmark real`, on measured data sets:

    real_logs.py       the public logs that are known: reads real_logs.toml
    real_fetched.py    makes data sets of them, from clones of their repositories
    peers              other libraries on the same runs; its own docstring lists them
    feedforward_fit.py the peer kS/kV/kA with delays
    real_score.py      the figure: fit percent of a free run
    real_run.py        runs discovery and its peers on one data set
    real_results.py    the kept results
    real_table.py      the table in tools/README.md, from the kept results alone

Both write a page, which `report` draws:

    page_content.py    what it shows: the cells of the tables, and the numbers of their figures

`brickpilot bench`:

    speed.py           the simulator and the links, beside a peer in the same process
    kernel_share.py    what kernel, interrupts and program take of the RCX's time, in simulated time
    step_budget.py     instructions, states, stack and bytes of a control step on the H8 simulator
    h8_states.py       states of each H8/300 instruction
    avr_budget.py      cycles, stack and bytes of a control period on simavr, drivers and interrupts included
"""
