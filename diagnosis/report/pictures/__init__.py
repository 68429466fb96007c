"""Pictures of the report: charts as SVG or for matplotlib, and what is drawn on them."""
