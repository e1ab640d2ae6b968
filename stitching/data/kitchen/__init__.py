"""Kitchen datasets: scripted demonstrations in human orders, and human ones, cut into skills."""
