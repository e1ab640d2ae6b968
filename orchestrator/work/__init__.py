"""From a spec to a finished ledger: plan, recipes, jobs, workers, building and playing."""
