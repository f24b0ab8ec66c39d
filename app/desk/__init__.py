"""The experimenters' desk: its pages, its JSON API, and who may use which of them."""
