# The images that come with chefbotd: the boards' builds, as they were when somebody last said `make images`.

IMAGES := $(BUILD)/atmega328p.hex $(BUILD)/tm4c123.bin

.PHONY: images images-check

images: boards  ## Put the boards' images where the Python package takes them from
	python3 list_images.py write $(IMAGES)

images-check: boards  ## Check that the images are what these sources make, byte for byte
	python3 list_images.py check $(IMAGES)
