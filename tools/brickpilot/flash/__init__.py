"""Puts an image on a brick.

`image_files` reads the file. `rom` puts a whole file on an RCX: firmware by its ROM, programs by brickOS, whose
download protocol `program` speaks over the infrared link. `avr` puts an image on an Arduino by avrdude.
"""
