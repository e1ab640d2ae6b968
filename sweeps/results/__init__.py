"""What a sweep leaves: its report, figures, table and MLflow view."""
