"""Puts an image on a brick.

`image_files` reads the file. `rom` puts a whole file on an RCX: the RCX's ROM takes firmware, and brickOS takes
programs. `program` speaks brickOS's download protocol. `avr` puts an image on an Arduino by avrdude.
"""
