"""Robosuite datasets: scripted demonstrations of any quality."""
