"""Verbs that give curves: responses, curves along any parameter, switched branches, tracked bifurcations, diagrams."""
