"""The paper's numbers, statistics, tables, figures and the report.

Reads finished ledgers; trains and simulates nothing, and imports none of Ray, torch or MuJoCo.
"""
