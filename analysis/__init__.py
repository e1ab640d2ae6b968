"""The paper's numbers, statistics, tables, figures and the report.

Reads finished ledgers; trains and simulates nothing, and imports none of Ray, torch or MuJoCo. Only
`analysis.render`, which a report starts as a process of its own, draws with MuJoCo.
"""
