"""The paper's figures and ours: one file a figure, each a function from plain data to a matplotlib figure.

What belongs to one person says so in its id (`style.belongs_to`), so that a page can point at a person in all
figures at once.
"""
