"""Puts an image on a brick.

srec and lx read the file, tower speaks to the infrared tower, rom and program (over lnp) to the brick; rcx delivers.
"""
