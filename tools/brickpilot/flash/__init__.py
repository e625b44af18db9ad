"""Puts an image on a brick.

srec and lx read the file, rom and program speak to the brick over the infrared link; rcx delivers.
"""
