"""Many episodes at once, judged against the truth. A command is a file or a folder of its name.

`reproduce`, `ablation`, `sensitivity`, `ring_scan`: studies of episodes, through `study`. `departures` and `sweeps` say
what is varied. `plans/`, `compare/`, `real_sonar/`: studies with results of their own kind.
`conformance/`, `figures/`: pages about the paper. `document`: what studies found goes into docs/.
Shared by all: `jobs`, `episode`, `runner`, `store` run and keep; `results`, `success`, `statistics` judge; `tables`,
`progress` show; `options` names what can be changed.
"""
