"""Robosuite datasets: scripted demonstrations at four levels of quality."""
