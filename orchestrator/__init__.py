"""From a spec to a finished ledger: plan, store, ledger, executors, tracking, command line."""
