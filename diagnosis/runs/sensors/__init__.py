"""Cross-checks of the redundant channels of a run, before anything is learned; no model of a ship."""
