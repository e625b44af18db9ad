"""Puts an image on a brick.

`srec` and `lx` read the file. `rom` and `program` speak the two download protocols over the infrared link. `rcx`
puts a whole file on a brick. `avr` has avrdude do so for an Arduino.
"""
