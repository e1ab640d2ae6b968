"""Hyperparameter search over specs: Optuna studies and the paper's α × β grid."""
