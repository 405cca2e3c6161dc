"""One way to run a study from a terminal: options, progress, refusals, Ctrl-C."""
