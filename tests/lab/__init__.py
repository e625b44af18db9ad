"""Measurements from a checkout, not in the package: how often discovery is right, and what a control step costs.

`sh tests/lab/run discover`, on data sets whose truth is known:

    sets.py            the data sets: `tests/hidden` makes them, or they exist already
    blind_test.py      runs discovery on each set and appends a result
    result.py          one result, a line of results.jsonl: truth and verdict
    score.py           the score of one result
    law_score.py       the score of one result of a quick suite: by mechanism, law and place
    claims.py          the required performance of discovery, as shares and figures over many results
    law_claims.py      the required performance for each quick suite
    table.py           the whole table, as an object and as text

`sh tests/lab/run real`, on measured data sets:

    real_logs.py       the public logs of real_logs.toml, and their data sets
    peers              other libraries on the same runs; its own docstring lists them
    real_score.py      the score: fit percent of a free run
    real_run.py        runs discovery and its peers on one data set
    real_results.py    the kept results
    real_table.py      the table in tools/docs/benchmarks.md, from the kept results alone

`brickpilot bench`: `--target` measures a brick's processor, `--scaling` measures how time grows with work:

    step_costs.py      the program that `--target` runs, and its tables
    rcx_budget.py      instructions, states, stack and bytes of a control step on the H8 simulator; the kernel's share
    avr_budget.py      cycles, stack and bytes of a control period on simavr, drivers and interrupts included
    control_peers.py   the control law on a brick's processor, compared with other arithmetics
    scaling.py         the growth of time with runs, samples, candidates and workers
    scaling_page.py    the program that `--scaling` runs, and its page

`discover` and `real` write a page (page.py). `parts.py`, `surer.py` and `flights.py` are separate programs. They test
whether parts of a log give the same answer, whether more runs give a surer answer, and whether a flight reveals effects
that the firmware does not know.
"""
