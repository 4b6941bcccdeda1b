"""Part II of the study: the report's six recommendations, followed; a chapter each, with claims set before looking."""
