"""Robosuite datasets: scripted demonstrations by hands of any quality."""
