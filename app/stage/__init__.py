"""The stage: two scenes side by side as one animated clip, shown to one participant through viser."""
