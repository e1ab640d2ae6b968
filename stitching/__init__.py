"""The method: environments, data, models, planning, stitchers and Algorithm 1.

Pure functions over arrays. Knows torch, numpy and the simulators; knows nothing of Ray, Optuna,
MLflow or files of results.
"""
