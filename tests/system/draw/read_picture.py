"""Reading of pictures, independent of the program that drew them."""
import numpy
from PIL import Image


def read_png(path):
    """An 8-bit RGB picture as (height, width, 3)."""
    with Image.open(path) as image:
        assert (image.format, image.mode) == ("PNG", "RGB"), (image.format, image.mode)
        return numpy.array(image)


def count_like(image, colour, reach=0.06):
    """Pixels whose hue is that of `colour`: the direction from grey agrees and is strong."""
    chroma = image.astype(float) - image.mean(axis=2, keepdims=True)
    wanted = numpy.array(colour, float) - numpy.mean(colour)
    strength = numpy.linalg.norm(chroma, axis=2)
    cosine = (chroma @ wanted) / (numpy.maximum(strength, 1e-9) * numpy.linalg.norm(wanted))
    return int(((cosine > 1 - reach) & (strength > 40)).sum())
