"""Tasks of robosuite 1.5.2 (Zhu et al. 2020, arXiv:2009.12293) for one Panda arm."""
