"""Legends: what the colours and sizes of a data scene mean, its title and its places, drawn over the picture.

content = legend_content(scene)                     # what the legend says, with ticks and positions in pixels
picture = drawn(content, width, height).pixels      # premultiplied, in linear light
"""
