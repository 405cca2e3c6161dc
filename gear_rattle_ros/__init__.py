"""Gear rattling as a live laboratory: simulate, steer, analyse, record, replay and watch."""
