"""One file per question: basins, lifetimes, orbit diagrams, crises."""
