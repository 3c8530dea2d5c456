"""The pictures in scenes/textures, each computed from nothing but the numbers in this file, so free to use like it.

    python scenes/make_textures.py
    python scenes/make_textures.py globe town -o somewhere/else

The same every time: all that is random has a seed. PNG, 8 bits, sRGB. The globe is a sketch: its coasts are lists of
places written down by hand, roughened a little; it serves for looking at, not for navigation.
"""

import argparse
import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont

# A picture is drawn so many times larger, and then shrunk: that smooths its edges.
FINER = 3

# Coasts: longitude and latitude in degrees, from place to place; beyond 180 on the far side of the date line.
COASTS = {
    "Eurasia": """-5.6 36 -8.9 37 -9.4 38.8 -8.8 41.5 -9.2 43.2 -4 43.5 -1.6 43.4 -1.2 45.8 -2.5 47.3 -4.7 48.3
        -1.5 48.7 -1.8 49.7 0.2 49.6 1.7 50.8 4 51.8 5 53.2 8 53.7 8.8 54.2 8.1 56 8.3 57 10.6 57.7 10.2 56.3
        9.6 55 10.9 54.2 14.2 53.9 18.5 54.7 19.8 54.5 21.1 55.5 21.3 57.2 24.2 57.3 23.5 58.8 28 59.6 30 59.9
        28.5 60.6 25 60.2 22.3 60.2 21.3 61.5 22.5 63.3 25.4 65 22.3 65.8 20.8 63.8 17.5 62 17.2 60.6 18.8 59.7
        16.6 58 16.4 56.6 14.3 55.6 12.9 55.5 11.8 57.5 10.7 59.2 8 58.1 5.5 58.8 5.1 61 8.5 63.5 12.5 66 15 68.2
        20 70 25.5 71 31 70.3 36 69.2 41 67.5 40.5 66.3 34 66.7 35 64.4 37.5 64 40.5 64.7 42 66.4 44 66 44 68.3
        48 67.7 54 68.4 60 68.8 66 69 68.5 68.3 67 70 69 72.8 72.8 72.5 72 69 73.5 67.5 74.5 69 75 72.2 80.5 73.6
        87 75 98 76.3 104 77.7 112 76.5 113 73.8 120 73 127 73.5 129 71.5 133 71.6 140 72.6 150 71.4 160 69.7
        170 70 178 69.4 190 66 182.5 65.4 178.5 64.6 179.5 62.5 172 60.8 165 60 163.3 58 162.5 56 160 53.2
        156.8 51 155.8 54 155.8 56.8 159.5 59.2 163.5 62 160 61.6 154.5 59.6 149 59.5 142 59 137 55.5 135.3 54.7
        140.3 53.9 140.4 50 138 46.5 135.2 44 131.9 43 130 42.2 127.6 39.8 129.4 37 129.2 35.2 126.5 34.4 126.6 37
        125 38 124.5 40 121.5 39 121.8 40.8 118.5 39 119.2 37.3 122.5 37.2 119.3 35 121.8 32 121.5 30 121.7 28.5
        119.7 26 117 23.6 113.5 22.3 110.5 21.2 109.8 20.4 108.2 21.6 106.5 20 105.8 18.8 108.8 15.5 109.3 12
        107 10.4 105 8.6 104.8 10.3 102.6 11.8 100.9 13.4 100 12.5 99.3 10 100.4 8 103.4 4.5 104.2 1.4 103.5 1.3
        101.3 3 100.3 6 98.3 8.2 98.6 12 97.6 16.4 95.4 15.8 94.3 17 92.3 20.8 91.5 22.6 88.5 21.7 87 21.2 85 19.5
        82.3 16.6 80.2 15.3 80.2 13 79.8 10.3 77.6 8.1 76.3 9.8 74.8 13 73.4 16.5 72.8 19.2 72.7 21.2 70.5 20.8
        69 22.4 67 24.8 61.5 25.1 57.3 25.7 56.5 27.1 54 26.6 51.5 27.9 50 30.2 48.2 30 48.3 28.5 50.2 26.6
        51.4 25.8 51.6 24.5 54.2 24.2 56.4 26.2 56.6 24.3 59.8 22.4 57.8 19 55.2 17.3 52 15.6 45 12.8 43.4 12.7
        42.7 16.3 39.2 21.3 35 28 34.9 29.5 34.3 27.8 32.6 29.9 32.3 31.2 34.3 31.3 35.8 35 36 36.8 34 36.2
        30.7 36.8 27.4 36.8 26.3 39 26.2 40.1 26 40.8 23.8 40.2 22.8 39.4 24 38 23 36.5 21.3 37 20.2 39.4
        19.4 41.6 17.5 43 14.5 44.8 13.7 45.7 12.3 45.2 12.4 44.2 14 42.5 16.1 41.8 18.4 40.1 16.9 40.4 16.6 38.7
        15.8 38 15.8 40 12.3 41.7 10.3 43.5 8.8 44.4 6.5 43.1 3.2 43.2 3.2 41.9 0.3 40.2 -0.1 38.7 -2 36.7""",
    "Africa": """-5.9 35.8 -2 35.2 5 36.8 10 37.3 11 34 15.3 32.3 19.8 30.5 21.6 32.8 25 31.6 29 30.9 32.3 31.2
        32.5 29.9 33.8 27.2 35.6 24 37.3 20 39.5 15.5 43.2 12.4 43.3 11.5 51.2 11.8 49 7 45 2 41.5 -1.8 39.3 -5
        40.6 -10.5 40.7 -15 36 -18.5 35 -20 35.4 -24 32.8 -26 31 -29.5 27.5 -33.2 22 -34.2 20 -34.8 18.4 -34.1
        17.8 -31 15.2 -27 14.4 -22.5 11.8 -17 13.7 -11.5 12.3 -6 9.2 -1.5 9.6 3.8 6 4.3 4 6.3 -2 4.8 -7.6 4.4
        -13.2 8.8 -16.7 12.4 -17.5 14.7 -16.3 19 -17 21 -14.8 25.5 -12.9 27.9 -9.8 30 -8.5 33.2""",
    "North America": """-168 65.6 -166.5 68.3 -162 70.3 -156.5 71.3 -145 70 -135 69 -128 70.2 -115 68.5 -108 68
        -96 67.8 -94 71.8 -90 69 -82 69.5 -81.5 67.2 -87 66 -87 64 -94 61 -94.5 58.8 -88 56.5 -82.3 55.1 -82 53
        -79 51.4 -79 54.5 -77 57 -78.3 58.8 -78 62.4 -73 62 -69.5 59 -65 60.2 -61.5 57 -56 53 -59.5 50.3 -66 50.2
        -69 48.3 -65 49 -64.5 47 -61 45.6 -65.5 43.6 -66.5 45 -70 43.7 -70.5 41.8 -74 40.6 -75.8 37.2 -75.7 35.3
        -79 33.4 -81.3 31 -80.2 27 -80.6 25.2 -81.8 26 -82.8 28 -84.2 30 -89.5 30.2 -90 29.2 -94.5 29.5 -97.3 27.5
        -97.7 22.5 -95.5 18.6 -91.8 18.5 -90.3 21 -87 21.4 -88.3 18 -88.5 15.8 -83.3 15 -83.7 11 -80 9.2 -77.3 8.6
        -78 7.8 -80.2 7.4 -83.5 8.5 -85.7 10.4 -87.6 13 -92 14.5 -96 15.8 -101.5 17.6 -105.6 20.3 -106 22.8
        -109.4 25.8 -112.5 29.8 -114.8 31.7 -112.7 28 -109.5 23.1 -112.1 25.3 -115 28 -117 32.5 -120.6 34.5
        -122.4 37.3 -124.3 40.4 -124 46.3 -124.6 48.3 -122.8 49 -127.5 51.5 -130.5 55 -134 58 -140 59.8 -146 60.8
        -151.5 59.3 -154 58 -158 56.2 -164.5 54.6 -157.5 58.7 -162 59.8 -165.5 61.5 -164.5 63.1 -161 64.5""",
    "South America": """-77.4 8.6 -75.5 10.6 -71.7 12.4 -71.3 11 -68.5 11.2 -62 10.7 -60 8.5 -57 6 -52 4.9 -50 1.2
        -48.5 -0.8 -44.3 -2.6 -39 -3.3 -35.3 -5.2 -34.9 -8 -37 -11.5 -39 -14 -39.2 -18 -41 -22 -44.5 -23.1
        -48.5 -26 -49 -28.7 -52 -32.5 -54.5 -34.8 -58.3 -34 -56.8 -36.4 -58 -38.3 -62.2 -39 -65 -41 -63.7 -42.6
        -66.5 -45.5 -65.8 -47.5 -69 -50.8 -68.4 -52.4 -71 -53.8 -74.5 -50 -75.5 -46.8 -73 -42 -73.5 -37.2
        -71.6 -33 -71.4 -29 -70.4 -23 -70.4 -18.3 -76 -14 -79 -8 -81.2 -5.5 -80.2 -3 -80.8 -1 -80 1 -78.7 2.3
        -77.3 4 -77.6 7""",
    "Australia": """113.7 -22.5 114.2 -26.3 115.6 -31.5 115.1 -34.3 118 -35 123.6 -33.9 129 -31.7 134.2 -33
        135.8 -34.8 137.8 -33 138.5 -35.6 140.5 -38 144.5 -38.3 146.4 -39 149.9 -37.5 151.3 -33.6 153.2 -28.5
        152.8 -25 149.3 -21.3 146 -18.8 145.4 -15 142.6 -10.8 141.6 -14 140.8 -17.5 139 -17.4 135.6 -15
        136.8 -12.2 132.6 -11.4 129.7 -14.8 126.8 -14 123.5 -17 122.2 -18.2 118.5 -20.3""",
    "Great Britain": """-5.6 50.1 -3.5 50.3 1.3 51.1 1.7 52.6 0.2 53.3 -1.3 55 -2.2 56.5 -2 57.6 -3.9 57.7
        -3.2 58.6 -5 58.5 -6 57 -5.3 55.4 -3.3 54.8 -3 53.4 -4.5 53.2 -4.3 52.4 -5.2 51.8 -3 51.4""",
    "Ireland": "-6.2 53.5 -6.3 52.2 -10 51.7 -9.8 54.2 -8 55.2 -5.7 54.6",
    "Iceland": "-22.5 63.9 -18.8 63.4 -14 64.7 -15 66.2 -20 66 -23.8 66.3 -24 65",
    "Honshu": """131 34.1 133.5 34.4 135.8 33.5 138.7 34.7 140.8 35.6 141.9 39.4 141.2 41.3 140 40.6 139.6 38.4
        137 37.2 136 35.7 132.6 35.4""",
    "Kyushu": "130 33.3 131.8 33.4 131.2 31.3 130.2 31.3",
    "Shikoku": "132.3 33.3 134.5 34.2 134.2 33.3 133 32.8",
    "Hokkaido": "140.2 41.6 143.2 42 145.4 43.3 142 45.4 141.4 43.3",
    "Sakhalin": "142.1 46.2 143.4 46.8 143.6 49.2 143.2 52.5 142.6 54.2 142 50",
    "Taiwan": "120.2 23 121 22 121.8 25 121 25",
    "Hainan": "108.7 19.2 110.5 18.6 111 20 109.5 20",
    "Luzon": "120.3 16 120.6 18.4 122.2 18.4 121.7 14.2 124 12.8 120.6 13.9",
    "Visayas": "122 10.6 123.3 11.4 125 12 125.2 10.2 123 9.3",
    "Mindanao": "122.2 7.2 125.5 5.8 126.4 8 125.4 9.7 123.5 8.5",
    "Borneo": "109 1.5 111.3 2.5 114 4.6 116.9 7 119.2 5.2 117.6 2 117.6 0.5 116.5 -2.5 114.5 -4.1 110.2 -2.8",
    "Sumatra": "95.4 5.5 97.7 5.2 100.5 2.4 103.6 -1 106 -3.2 105.8 -5.8 104 -5.6 101 -2.8 98.7 1.7",
    "Java": "105.3 -6.8 106.8 -6 110.8 -6.5 114.4 -7.8 114.3 -8.6 109 -7.7",
    "Sulawesi": """119 -5.5 118.9 -2.8 120 0.8 125 1.6 121 0.2 120.4 -1 123.3 -0.9 121.8 -2 122.8 -4.2 121.3 -4.5
        120.8 -3 120.4 -5.5""",
    "New Guinea": """131 -0.8 134 -0.8 135 -3.3 138 -1.8 144.5 -3.8 147.8 -6 150.7 -10.4 147 -9.5 144 -7.7
        142 -9.2 138.5 -8.2 138 -5.4 133 -4""",
    "Timor": "123.5 -10.3 127.2 -8.4 126 -9.4",
    "Flores": "119 -8.8 123 -8.2 122 -8.9",
    "New Caledonia": "164 -20.1 165 -20.6 167.2 -22.3 166 -22.2",
    "Sri Lanka": "79.8 8 80.2 6 81.7 7 80.8 9.3",
    "Madagascar": "49.3 -12.1 50.4 -15.7 47.2 -24.9 45 -25.5 43.4 -22.3 44.4 -19.8 44.2 -16.4 47.5 -14.8",
    "North Island": "172.8 -34.5 175.5 -36.8 178.4 -37.8 176.9 -39.5 175.3 -41.6 173.8 -39.3 174.8 -37.5",
    "South Island": "172.7 -40.6 174.2 -41.6 172.8 -43.7 170.7 -46 168.5 -46.6 166.5 -45.9 168.5 -44",
    "Tasmania": "144.7 -40.8 148.3 -40.9 147.8 -43 146 -43.5",
    "Cuba": "-84.8 21.9 -82.5 23.1 -79.3 22.8 -75.5 20.8 -74.2 20.2 -77.6 19.9 -78 20.8 -82.5 22.5",
    "Hispaniola": "-74.4 18.5 -73 19.9 -69.8 19.7 -68.4 18.5 -71.5 17.9",
    "Sicily": "12.5 38 15.6 38.2 15.1 36.7",
    "Sardinia": "8.3 39 8.3 41 9.7 41 9.6 39.2",
    "Corsica": "8.6 42.5 9.4 43 9.4 41.5",
    "Crete": "23.5 35.5 26.2 35.3 24 34.9",
    "Cyprus": "32.4 35 34.5 35.6 33.3 34.6",
    "Baffin Island": "-61.5 66.5 -68 63 -73 64.5 -73 68 -80 70 -89 71 -89 73.7 -80 73.8 -72 71.5 -65 68.5",
    "Victoria Island": "-105 68.8 -101.5 69.8 -105 73 -115 73.3 -119 71.5 -116 69",
    "Banks Island": "-125.5 72 -123 74.3 -116 73.6 -120 72 -123 71.2",
    "Ellesmere Island": "-90 76.5 -78 76.5 -76 79 -62 82.4 -72 83.1 -90 81.8 -88 79",
    "Devon Island": "-92 74.8 -80 74.8 -80 75.8 -92 76.4",
    "Axel Heiberg": "-96 78.3 -90 79 -92 81.2",
    "Melville Island": "-117 75.2 -106 75 -109 76.5",
    "Southampton Island": "-87 64 -80.5 63.8 -84 66",
    "Newfoundland": "-59.2 47.7 -53 46.8 -53.2 48.8 -55.5 51.5 -57.5 50",
    "Vancouver Island": "-128 50.7 -125.3 50 -123.5 48.4 -126 49.2",
    "Tierra del Fuego": "-68.5 -52.7 -65.3 -54.8 -70 -55.2 -72.5 -53.9",
    "Falklands": "-61 -51.8 -58 -51.4 -59.5 -52.3",
    "Svalbard": "11 79.6 20 80.4 27 80 21 78.4 16.5 76.7 13.5 78",
    "Novaya Zemlya": "52 71 57.5 70.7 57 73 68.5 76.7 60 76.2 54 73.5",
    "Severnaya Zemlya": "95 79 105 79 97 81",
    "New Siberian Islands": "137 75.5 150 75 142 73.6",
    "Hawaii": "-156 19 -155 19.6 -156 20.2",
}
ICE = {
    "Greenland": """-73 78.2 -67 80.5 -58 82.2 -40 83.3 -22 82.3 -12 81.3 -19 78.5 -19.5 75 -22 72.2 -25 70.3
        -32 68 -40 65 -43 60.1 -48.5 61.5 -52 64.5 -54 68 -51.5 70 -55.5 72.5 -60 75.8 -68 76""",
    "Antarctica": """-180 -90 -180 -78 -165 -78.3 -150 -76.8 -135 -74.5 -110 -74.5 -100 -72.5 -80 -73 -68 -70
        -66 -67 -58 -63.4 -61 -68 -61 -75.5 -50 -78 -35 -78 -25 -75.5 -12 -71.5 0 -70 20 -70 33 -68.7 45 -67.7
        55 -66 68 -68 75 -69.5 85 -66.5 100 -66 115 -66.5 130 -66.2 142 -67 155 -69 165 -71 170 -72.5 165 -77
        170 -78 180 -78 180 -90""",
}
LAKES = {
    "Black Sea": """28 41.8 31.3 41.3 35 42 38 41 41.5 41.6 39 43.9 37.5 45 35.2 45.2 33.5 44.5 32.6 45.6
        31.5 46.6 29.7 45.2 28.5 43.5""",
    "Caspian Sea": "50 46.6 47.5 43 49.5 40.5 49 38 52 36.8 54 37.2 53 40 51 44 53 45.5 51.5 47",
    "Baikal": "104 51.6 106 52.4 109.5 55.7 109.8 54 106.5 51.8",
    "Superior": "-92 46.7 -88.3 48.8 -84.8 46.6 -88 47 -90.5 46.7",
    "Michigan": "-87.9 42 -86.3 42.2 -86.3 44.5 -85 45.9 -87.8 45",
    "Huron": "-84.5 46 -82.4 43.1 -80 44.6 -81 45.9",
    "Erie": "-83.3 41.7 -79 42.9 -81 42.8",
    "Ontario": "-79.7 43.3 -76.3 44 -76.5 43.4",
    "Great Bear Lake": "-125 65.3 -119 65.2 -121 66.6",
    "Great Slave Lake": "-117 61 -109 62.6 -114 62.4",
    "Winnipeg": "-98.8 53.6 -96.4 50.6 -97.4 53.4",
    "Victoria": "31.8 -1 33.8 0.3 34 -1.2 32.5 -2.5",
}
# Where hardly anything grows: middles and half widths, in degrees.
DESERTS = (
    (-5, 23, 14, 7), (6, 24, 14, 7), (16, 24, 14, 7), (28, 24, 11, 7), (47, 23, 9, 8), (60, 31, 10, 6), (56, 41, 8, 4),
    (66, 43, 9, 5), (83, 40, 9, 4), (95, 42, 9, 4), (106, 43, 8, 4), (71, 27, 4, 4), (123, -25, 8, 7),
    (133, -25, 9, 7), (19, -24, 5, 6), (-70, -23, 3, 8), (-69, -44, 4, 7), (-112, 35, 7, 6), (-105, 27, 4, 5),
    (47, 6, 4, 5),
)  # fmt: skip
# Mountains, from place to place, and how wide they are in degrees.
RANGES = {
    "-80 -4 -76 -12 -69 -16 -68 -24 -70 -33 -72 -43 -73 -50": 2.2,
    "-150 63 -138 60 -128 56 -121 51 -115 47 -110 43 -106 38 -105 33": 2.6,
    "-121 46 -121 40 -118 36": 1.2,
    "72 36 80 32 88 28.5 96 29": 1.8,
    "78 34 88 34 98 34": 3.2,
    "70 39 78 42 88 43 95 49 108 51": 1.6,
    "6 45 10 46.7 14 47": 1.1,
    "40 43.3 47 41.6": 0.9,
    "37 38 44 38 50 34 55 30": 1.4,
    "7 60 14 65 20 68.5": 1.4,
    "60 52 59 60 64 66": 0.8,
    "-8 31 0 34 8 35.5": 1.0,
    "38 13 39 8 36 1 35 -5": 1.6,
    "133 -3.8 140 -4.6 146 -6.5": 1.2,
    "120 63 130 66 142 66 150 62": 1.4,
    "168 -45 171.5 -43": 0.9,
    "145 -37 149 -34": 0.9,
    "-84 34 -79 38 -74 43": 1.0,
}


def rgb(text: str) -> np.ndarray:
    """A colour as three numbers from 0 to 1."""
    return np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)]) / 255


def blended(low: np.ndarray, high: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Pictures or colours, (H, W, 3) or (3), by a weight, (H, W)."""
    return low + np.clip(weight, 0, 1)[..., None] * (high - low)


def picture(values: np.ndarray) -> Image.Image:
    return Image.fromarray(np.round(np.clip(values, 0, 1) * 255).astype(np.uint8))


def stepped(values: np.ndarray, steps: int) -> np.ndarray:
    """The values in so many steps, which makes a file small."""
    return np.round(values * steps) / steps


def mixed(x: np.ndarray) -> np.ndarray:
    """A well mixed 32-bit number for each. Source: Wellons' hash-prospector."""
    x = (x ^ (x >> np.uint32(16))) * np.uint32(0x21F0AAAD)
    x = (x ^ (x >> np.uint32(15))) * np.uint32(0xD35A2D97)
    return x ^ (x >> np.uint32(15))


def noise(p: np.ndarray, seed: int, octaves: int = 4) -> np.ndarray:
    """Smooth noise with a mean of about 0 and a size of about 1, by blending the random numbers of a lattice; each
    octave is twice as fine and half as high. Shapes: (..., 3); (...)."""
    p, total, high = np.asarray(p, np.float32), 0.0, 1.0
    for octave in range(octaves):
        low = np.floor(p)
        t = p - low
        weights = t * t * t * (t * (6 * t - 15) + 10)
        place = low.astype(np.int32).view(np.uint32)

        def blend(axis: int, key: np.ndarray, place: np.ndarray = place, weights: np.ndarray = weights) -> np.ndarray:
            if axis == 3:
                return key * np.float32(2.0**-31) - 1
            near, far = (blend(axis + 1, mixed(key ^ (place[..., axis] + np.uint32(i)))) for i in (0, 1))
            return near + weights[..., axis] * (far - near)

        total = total + high * blend(0, np.full(p.shape[:-1], seed + 1000 * octave, np.uint32))
        p, high = 2 * p + np.float32(17.3), 0.5 * high
    return total


def enlarged(values: np.ndarray, width: int, height: int) -> np.ndarray:
    """A smooth picture of one number a pixel, larger."""
    image = Image.fromarray(np.asarray(values, np.float32))
    return np.asarray(image.resize((width, height), Image.Resampling.BICUBIC))


def directions(width: int, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Longitude, latitude in degrees and the unit vector of each pixel of a map of a sphere."""
    lon, lat = np.meshgrid(
        360 * (np.arange(width) + 0.5) / width - 180,
        90 - 180 * (np.arange(height) + 0.5) / height,
    )
    a, b = np.radians(lon), np.radians(lat)
    return lon, lat, np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], -1)


def drawn(places: dict[str, str], width: int, height: int) -> np.ndarray:
    """What lies within coasts, as a map of 0 and 1."""
    mask = Image.new("L", (width, height))
    pen = ImageDraw.Draw(mask)
    for text in places.values():
        numbers = np.array(text.split(), float).reshape(-1, 2)
        for turn in (-360, 0, 360):
            x = (numbers[:, 0] + turn + 180) / 360 * width
            y = (90 - numbers[:, 1]) / 180 * height
            pen.polygon(list(zip(x, y)), fill=255)
    return np.asarray(mask) / 255


def looked_up(mask: np.ndarray, lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
    height, width = mask.shape
    x = np.floor((lon + 180) / 360 * width).astype(int) % width
    y = np.clip(np.floor((90 - lat) / 180 * height).astype(int), 0, height - 1)
    return mask[y, x]


def shrunk(values: np.ndarray, width: int, height: int) -> np.ndarray:
    """The mean of each block of pixels."""
    h, w = values.shape[0] // height, values.shape[1] // width
    return values.reshape(height, h, width, w, *values.shape[2:]).mean(axis=(1, 3))


def wide_blur(values: np.ndarray, radius: float) -> np.ndarray:
    """A blur that knows that a map's left and right edges meet."""
    w = values.shape[1]
    image = Image.fromarray((np.concatenate([values] * 3, 1) * 255).astype(np.uint8))
    return np.asarray(image.filter(ImageFilter.GaussianBlur(radius)))[:, w : 2 * w] / 255


def spots(places: tuple, lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
    """Soft ellipses, 1 in their middles, that flow into one another."""
    gap = np.ones(lon.shape)
    for x, y, w, h in places:
        gap *= 1 - np.exp(-(((lon - x) / w) ** 2) - ((lat - y) / h) ** 2)
    return 1 - gap


def ridges(ranges: dict[str, float], lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
    """Soft lines from place to place, 1 in their middles."""
    found = np.zeros(lon.shape)
    for text, wide in ranges.items():
        numbers = np.array(text.split(), float).reshape(-1, 2)
        for (x, y), (ex, ey) in itertools.pairwise(numbers):
            shrink = np.cos(np.radians((y + ey) / 2))
            dx, dy = (ex - x) * shrink, ey - y
            px, py = (lon - x) * shrink, lat - y
            along = np.clip((px * dx + py * dy) / (dx * dx + dy * dy), 0, 1)
            off = np.hypot(px - along * dx, py - along * dy)
            found = np.maximum(found, np.exp(-((off / wide) ** 2)))
    return found


def globe() -> Image.Image:
    """A map of the Earth: north up, Greenwich in the middle."""
    width, height = 1024, 512
    lon, lat, d = directions(width, height)
    # Coasts are drawn straight from place to place, and looked up at places that noise has moved.
    rough = [enlarged(1.1 * noise(14 * d, seed, 4), 2 * width, 2 * height) for seed in (1, 2)]
    wide, high, _ = directions(2 * width, 2 * height)
    east, north = wide + rough[0] / np.maximum(np.cos(np.radians(high)), 0.15), high + rough[1]
    land, ice, lakes = (looked_up(drawn(x, 4 * width, 4 * height), east, north) for x in (COASTS, ICE, LAKES))
    land, ice = shrunk(np.maximum(land * (1 - lakes), ice), width, height), shrunk(ice, width, height)

    relief, grain, away = noise(9 * d, 3, 5), noise(30 * d, 4, 3), np.abs(lat + 4 * noise(5 * d, 5, 3))
    ground = blended(rgb("#3e6b2f"), rgb("#7d8f45"), (away - 6) / 14)
    ground = blended(ground, rgb("#5d8442"), (away - 24) / 12)
    ground = blended(ground, rgb("#3f6340"), (away - 46) / 8)
    ground = blended(ground, rgb("#8b8d74"), (away - 62) / 6)
    ground = blended(ground, rgb("#e4e8e8"), (away - 73) / 5)
    ground = blended(ground, rgb("#d9b77a"), 1.4 * spots(DESERTS, lon, lat) - 0.35 + 0.25 * relief)
    heights = ridges(RANGES, lon + 0.7 * grain, lat + 0.7 * relief)
    ground = blended(ground, rgb("#7d6b4a"), 0.95 * heights - 0.15 + 0.2 * grain)
    ground = blended(ground, rgb("#e9e7e2"), 1.5 * heights - 1.35 + 0.35 * grain + (away - 35) / 130)
    ground = ground * (1 + 0.07 * stepped(relief, 12) + 0.035 * stepped(grain, 6))[..., None]
    ground = blended(ground, rgb("#eef3f6") * (1 + 0.03 * stepped(relief, 8))[..., None], 1.3 * ice)

    shelf = 1.1 * wide_blur(land, 6) + 0.5 * wide_blur(land, 2)
    water = blended(rgb("#10305a"), rgb("#2f6f9f"), stepped(shelf + 0.06 * relief, 40))
    water = blended(water, rgb("#174573"), 0.6 * (1 - np.abs(lat) / 45))
    water = blended(water, rgb("#dfe9ee"), (np.maximum(lat - 79, -lat - 71) + 3 * relief) / 3)
    whole = blended(water, ground, land)

    line = np.zeros((height, width))
    for degrees in range(-180, 180, 15):
        line[:, round((degrees + 180) / 360 * width)] = 1
    for degrees in range(-75, 90, 15):
        line[round((90 - degrees) / 180 * height)] = 1
    line[height // 2 - 1 : height // 2 + 1] = 1
    line[:, width // 2 - 1 : width // 2 + 1] = 1
    return picture(blended(whole, rgb("#ffffff"), 0.13 * line))


def moon() -> Image.Image:
    """A map of a moon of our own: plains of lava, and craters of all sizes."""
    width, height = 768, 384
    lon, lat, d = directions(width, height)
    rng = np.random.default_rng(20)
    ground = 0.12 * noise(6 * d, 30, 5)
    rays = np.zeros(lon.shape)
    sizes = np.sort(0.012 * (1 - rng.random(650)) ** -0.62)[::-1]
    for size in np.minimum(sizes, 0.22):
        centre = rng.normal(size=3)
        centre /= np.linalg.norm(centre)
        r = np.arccos(np.clip(d @ centre, -1, 1)) / size
        bowl = np.where(r < 1, r**2 - 0.6, 0.4 * np.exp(-(((r - 1) / 0.28) ** 2)))
        ground += 3.2 * size**0.8 * np.where(r < 3, bowl, 0)
        if size > 0.05 and rng.random() < 0.3:
            aside = np.cross(centre, [0.3, 0.5, 0.8])
            turn = np.arctan2(d @ np.cross(centre, aside), d @ aside)
            comb = noise(np.stack([2.2 * np.cos(turn), 2.2 * np.sin(turn), 0 * turn + size], -1), 40, 4)
            rays = np.maximum(rays, np.clip(comb + 0.15, 0, 1) * np.exp(-r / 3.5) * (r > 0.6))
    plains = 1 / (1 + np.exp(-9 * (noise(1.5 * d, 53, 4) - 0.12)))
    # The slope to the north-west, as a low sun would show it.
    dy, dx = np.gradient(ground)
    slope = dx / np.maximum(np.cos(np.radians(lat)), 0.25) + dy
    light = 0.56 - 0.24 * plains + 0.02 * ground + 0.16 * rays + np.clip(1.5 * slope, -0.2, 0.2)
    light = stepped(light + 0.02 * noise(60 * d, 60, 2), 90)
    return picture(light[..., None] * np.array([1, 0.985, 0.95]))


def add_stars(light: np.ndarray, places: np.ndarray, strengths: np.ndarray, colours: np.ndarray) -> None:
    """Adds soft dots to a picture that repeats. Shapes: (H, W, 3); (N, 2) in pixels; (N); (N, 3)."""
    height, width = light.shape[:2]
    for (x, y), strength, colour in zip(places, strengths, colours):
        sharp = 0.55 + 0.35 * min(strength, 3) ** 0.5
        reach = int(4 * sharp) + 1
        i, j = (np.arange(int(c) - reach, int(c) + reach + 1) for c in (x, y))
        across, down = (np.exp(-(((k + 0.5 - c) / sharp) ** 2)) for k, c in ((i, x), (j, y)))
        dot = strength * down[:, None] * across
        light[np.ix_(j % height, i % width)] += dot[..., None] * colour


def star_colours(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """How bright so many stars are, few of them very, and their colours from orange to blue."""
    strength = np.minimum(0.16 * (1 - rng.random(n)) ** -0.75, 4)
    heat = rng.random(n)[:, None]
    warm, cold = np.array([1.0, 0.66, 0.38]), np.array([0.52, 0.72, 1.0])
    return strength, np.where(heat < 0.5, warm + 2 * heat * (1 - warm), 1 + (2 * heat - 1) * (cold - 1))


def encoded(light: np.ndarray) -> np.ndarray:
    """sRGB numbers of linear light."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def stars() -> Image.Image:
    """A sheet of stars that repeats in both directions."""
    side, rng = 768, np.random.default_rng(7)
    light = np.zeros((side, side, 3))
    n = 1500
    strength, colour = star_colours(rng, n)
    add_stars(light, rng.random((n, 2)) * side, strength, colour)
    return picture(encoded(light))


def sky() -> Image.Image:
    """A piece of the night sky with a band of stars across, like the Milky Way. It does not repeat."""
    width, height = 896, 560
    rng = np.random.default_rng(11)
    y, x = (np.mgrid[0:height, 0:width] + 0.5) / height

    def off(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """How far from the middle of the band, in its half widths."""
        return ((y - 0.86) * 0.8 + (x - 0.15) * 0.52 - 0.09 * np.sin(2.5 * x)) / 0.14

    at = rng.random((9000, 2)) * [width / height, 1]
    at = at[rng.random(len(at)) < 0.11 + 0.5 * np.exp(-(off(*at.T) ** 2))]
    strength, colour = star_colours(rng, len(at))
    light = np.zeros((height, width, 3))
    add_stars(light, at * height, 0.6 * strength, colour)
    p = np.stack([x, y, 0 * x], -1)
    away = off(x, y) + 0.5 * noise(3 * p, 70, 3)
    cloud = np.exp(-(away**2)) * np.clip(0.7 + 0.5 * noise(4 * p, 71, 4), 0, 2)
    dust = np.clip(noise(np.stack([5 * x, 9 * (y + 0.55 * x), 0 * x], -1), 72, 5) - 0.05, 0, 1) * np.exp(
        -((away / 0.5) ** 2)
    )
    # Stars too faint to be told apart: their grain also hides the steps of 8 bits.
    grain = 0.6 + 0.8 * rng.random((height, width))
    glow = np.clip(cloud - 1.1 * dust, 0, 2) * grain
    tint = blended(np.array([0.6, 0.75, 1.2]), np.array([1.1, 0.95, 0.8]), glow)
    whole = picture(encoded(light + 0.05 * glow[..., None] * tint))
    return whole.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


def wood() -> Image.Image:
    """A floor of boards that repeats in both directions: six of them, their joints staggered."""
    width, height, boards = 768, 768, 6
    rng = np.random.default_rng(3)
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    board = np.floor(v * boards)
    joint = np.array([0.12, 0.71, 0.4, 0.93, 0.27, 0.58])[board.astype(int)]
    along = (u - joint) % 1
    half = np.floor(2 * along)
    number = 2 * board + half
    tone = rng.permutation(np.linspace(-1, 1, 2 * boards))[number.astype(int)]
    across = v * boards - board
    # Grain: noise that is long along a board, and rings of a trunk cut lengthwise. It ends where its board ends.
    p = np.stack([3 * (2 * along - half), 5 * across, 9.7 * number], -1)
    bend = noise(p * [0.7, 0.35, 1], 80, 2)
    rings = np.sin(2 * np.pi * (4 * across + 1.1 * bend))
    fibre = noise(p * [2, 14, 1], 90, 3)
    dark = 0.45 + 0.25 * tone + 0.14 * rings + 0.16 * fibre
    colour = blended(rgb("#c08a52"), rgb("#8a5a31"), stepped(dark, 40))
    gap = np.minimum(across, 1 - across) / boards * height
    end = np.minimum(2 * along - half, 1 - (2 * along - half)) / 2 * width
    seam = np.clip(1.6 - np.minimum(gap, end), 0, 1)
    return picture(blended(colour, rgb("#3a2415"), 0.85 * seam))


def font(size: float) -> ImageFont.FreeTypeFont:
    return ImageFont.load_default(size)


def word(pen: ImageDraw.ImageDraw, at: tuple, text: str, size: float, colour: str, halo: str = "") -> None:
    edge = {"stroke_width": max(1, round(size / 9)), "stroke_fill": halo} if halo else {}
    pen.text(at, text, fill=colour, font=font(size), anchor="mm", **edge)


def chart() -> Image.Image:
    """A chart of (u, v): 6 x 6 fields with names, A1 at the lower left, and arrows; nothing in it is symmetrical."""
    side, fields = 480 * FINER, 6
    image = Image.new("RGB", (side, side))
    pen = ImageDraw.Draw(image)
    field, ink = side // fields, "#20242c"
    for column in range(fields):
        for row in range(fields):
            u, v = (column + 0.5) / fields, (row + 0.5) / fields
            light = 0.97 if (column + row) % 2 else 0.78
            # Red grows with u and green with v, as in shading uv.
            colour = tuple(int(255 * light * c) for c in (0.45 + 0.55 * u, 0.45 + 0.55 * v, 0.85 - 0.4 * u))
            x, y = column * field, side - (row + 1) * field
            pen.rectangle([x, y, x + field - 1, y + field - 1], colour)
            word(pen, (x + field / 2, y + field / 2), "ABCDEF"[column] + str(row + 1), 0.52 * field, ink)
    pen.rectangle([0, 0, side - 1, side - 1], outline=ink, width=side // 120)
    middle, edge = side / 2, side // 200
    for name, colour, x, y in (("u", "#c3202b", 1, 0), ("v", "#137a33", 0, -1)):
        # The shaft and the head of an arrow, along its own direction and across.
        shape = [(0, 0.07), (1.72, 0.07), (1.72, 0.45), (2.7, 0), (1.72, -0.45), (1.72, -0.07), (0, -0.07)]
        turned = [(middle + field * (a * x - b * y), middle + field * (a * y + b * x)) for a, b in shape]
        pen.polygon(turned, colour, "#ffffff", edge)
        word(pen, (middle + 1.98 * field * x, middle + 1.98 * field * y), name, 0.5 * field, "#ffffff")
    r = 0.14 * field
    pen.ellipse([middle - r, middle - r, middle + r, middle + r], "#ffffff", ink, edge)
    return image.resize((480, 480), Image.Resampling.LANCZOS)


def split(box: tuple, rng: np.random.Generator, least: float) -> list[tuple]:
    """A rectangle cut into smaller ones, across its longer side again and again."""
    x0, y0, x1, y1 = box
    w, h = x1 - x0, y1 - y0
    if max(w, h) < 2 * least or (max(w, h) < 3 * least and rng.random() < 0.35):
        return [box]
    at = rng.uniform(0.38, 0.62)
    if w > h:
        middle = x0 + at * w
        halves = (x0, y0, middle, y1), (middle, y0, x1, y1)
    else:
        middle = y0 + at * h
        halves = (x0, y0, x1, middle), (x0, middle, x1, y1)
    return [piece for half in halves for piece in split(half, rng, least)]


def town() -> Image.Image:
    """The plan of Marrowby, a town that does not exist: north up, two units of length across."""
    side = 1024 * 2
    image = Image.new("RGB", (side, side), "#f1ece0")
    pen = ImageDraw.Draw(image)
    rng = np.random.default_rng(42)

    def bent(x: np.ndarray, y: np.ndarray) -> list[tuple]:
        """Where streets of a square grid run: turned, and bent a little."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        a = 0.16 + 0.1 * np.sin(2.2 * x + 1) * np.cos(1.7 * y)
        px = x * np.cos(a) - y * np.sin(a) + 0.05 * np.sin(3.1 * y)
        py = x * np.sin(a) + y * np.cos(a) + 0.05 * np.sin(2.7 * x + 0.6)
        return list(zip((0.5 + 0.5 * px) * side, (0.5 + 0.5 * py) * side))

    def outline(box: tuple, inset: float) -> list[tuple]:
        x0, y0, x1, y1 = box[0] + inset, box[1] + inset, box[2] - inset, box[3] - inset
        t = np.linspace(0, 1, 7)[:-1]
        return bent(
            np.concatenate([x0 + t * (x1 - x0), x1 + 0 * t, x1 + t * (x0 - x1), x0 + 0 * t]),
            np.concatenate([y0 + 0 * t, y0 + t * (y1 - y0), y1 + 0 * t, y1 + t * (y0 - y1)]),
        )

    for block in split((-1.5, -1.5, 1.5, 1.5), rng, 0.085):
        x, y = (block[0] + block[2]) / 2, (block[1] + block[3]) / 2
        r = np.hypot(x, y)
        if r > 0.95 + 0.25 * rng.random():
            field = ("#e4e6c3", "#dbe3b8", "#ebe3c4", "#d5dfb6")[rng.integers(4)]
            pen.polygon(outline(block, 0.006), field)
        elif rng.random() < 0.08:
            pen.polygon(outline(block, 0.012), "#b9d39b")
            for _ in range(14):
                tree = (rng.uniform(block[i] + 0.03, block[i + 2] - 0.03) for i in (0, 1))
                (cx, cy), size = bent(*([c] for c in tree))[0], rng.uniform(6, 12)
                pen.ellipse([cx - size, cy - size, cx + size, cy + size], "#8fb573")
        else:
            pen.polygon(outline(block, 0.012), "#ddd2bf")
            for house in split((block[0] + 0.016, block[1] + 0.016, block[2] - 0.016, block[3] - 0.016), rng, 0.026):
                if rng.random() < 0.86:
                    tone = ("#c7ab8d", "#bf9f80", "#cdb698", "#c9a08a")[rng.integers(4)]
                    pen.polygon(outline(house, 0.0028), tone)

    t = np.linspace(-1.6, 1.6, 200)

    def way(points: list[tuple], colour: str, width: int, edge: str = "") -> None:
        if edge:
            pen.line(points, edge, width + 10, joint="curve")
        pen.line(points, colour, width, joint="curve")

    park = bent(0.36 + 0.2 * np.cos(2 * t) + 0.02 * np.cos(6 * t), -0.42 + 0.15 * np.sin(2 * t))
    pen.polygon(park, "#b9d39b")
    pond = bent(0.42 + 0.075 * np.cos(2 * t), -0.4 + 0.045 * np.sin(2 * t))
    pen.polygon(pond, "#9cc4d9")
    river = bent(t, 0.3 * np.sin(1.9 * t + 0.5) + 0.2 * t + 0.12)
    way(river, "#9cc4d9", 84, "#f1ece0")
    sea = [(side, side * 0.52), (side * 0.93, side * 0.62), (side * 0.9, side * 0.74), (side * 0.8, side * 0.83),
           (side * 0.72, side * 0.93), (side * 0.7, side), (side, side)]  # fmt: skip
    pen.line(sea[:-1], "#e8d7ac", 60, joint="curve")
    pen.polygon(sea, "#9cc4d9")
    ring = bent(0.62 * np.cos(2 * t), 0.62 * np.sin(2 * t))
    east_west = bent(t, -0.18 + 0.1 * np.sin(2 * t))
    quay = np.linspace(-1.6, 0.52, 200)
    for road in (ring, east_west, bent(-0.12 + 0.06 * np.sin(3 * t), t), bent(quay, 0.9 * quay - 0.2)):
        way(road, "#f6d887", 24, "#a98d4e")
    rail = bent(t, -0.75 * t - 0.42)
    pen.line(rail, "#4a4a4a", 12, joint="curve")
    for first, last in list(itertools.pairwise(rail))[::2]:
        pen.line([first, last], "#f1ece0", 6)
    square = bent([-0.14], [-0.16])[0]
    pen.ellipse([square[0] - 52, square[1] - 52, square[0] + 52, square[1] + 52], "#f6efe0", "#a98d4e", 6)

    ink, halo = "#3b3226", "#f6f1e6"
    for text, (x, y), size in (
        ("OLD TOWN", (0.39, 0.47), 58), ("Northgate", (0.55, 0.11), 50), ("Mill Fields", (0.14, 0.36), 46),
        ("Castle Park", (0.7, 0.29), 42), ("HARBOUR", (0.72, 0.72), 54), ("Tannery", (0.27, 0.62), 46),
        ("Southbank", (0.45, 0.83), 50), ("West Cross", (0.13, 0.8), 42), ("Eastfold", (0.88, 0.4), 46),
    ):  # fmt: skip
        word(pen, (x * side, y * side), text, size, ink, halo)
    word(pen, (0.91 * side, 0.88 * side), "The Sound", 50, "#2f6286")
    word(pen, (0.1 * side, 0.268 * side), "River Marr", 38, "#2f6286", "#cfe3ec")
    pen.rectangle([40, 40, 560, 190], halo, ink, 6)
    word(pen, (300, 96), "MARROWBY", 82, ink)
    word(pen, (300, 160), "plan of the town", 34, ink)
    x, y = side - 150, 170
    pen.polygon([(x, y - 110), (x + 36, y + 60), (x, y + 30), (x - 36, y + 60)], ink)
    word(pen, (x, y + 100), "N", 64, ink, halo)
    for i in range(4):
        pen.rectangle([70 + 80 * i, side - 80, 150 + 80 * i, side - 58], halo if i % 2 else ink, ink, 3)
    word(pen, (230, side - 112), "400 m", 36, ink, halo)
    pen.rectangle([0, 0, side - 1, side - 1], outline=ink, width=14)
    small = image.resize((1024, 1024), Image.Resampling.LANCZOS)
    return small.quantize(96, dither=Image.Dither.NONE)


def painting() -> Image.Image:
    """A picture in the manner of no one in particular: a sun, hills, water and two sails, on canvas."""
    w, h = 480, 600
    y, x = np.mgrid[0:h, 0:w] / h
    stroke = enlarged(noise(np.stack([8 * x, 36 * y, 0 * x], -1), 100, 3), FINER * w, FINER * h)
    y, x = np.mgrid[0 : FINER * h, 0 : FINER * w] / (FINER * h)
    colour = blended(rgb("#e9c98b"), rgb("#c8563b"), (y - 0.08) / 0.5 + 0.07 * stroke)
    sun = np.hypot(x - 0.52, y - 0.34) - 0.003 * stroke
    colour = blended(colour, rgb("#f6e7c0"), (0.155 - sun) * 400)
    colour = blended(colour, rgb("#d9482f"), (0.13 - sun) * 400)
    hills = (
        ("#6d3b5e", 0.52 + 0.06 * np.sin(7 * x + 0.4) + 0.03 * np.sin(17 * x)),
        ("#2f4a73", 0.62 + 0.05 * np.sin(6 * x + 2.5)),
        ("#1f7a7d", 0.72 + 0.035 * np.sin(9 * x + 1.2)),
        ("#143b4f", 0.84 + 0.03 * np.sin(8 * x + 4)),
    )
    for shade, edge in hills:
        tone = rgb(shade) * (1 + 0.1 * stroke + 0.5 * (y - edge))[..., None]
        colour = blended(colour, tone, (y - edge + 0.003 * stroke) * 400)
    for left, top, size in ((0.17, 0.5, 0.2), (0.37, 0.6, 0.13)):
        across, down = (x - left) / size, (y - top) / size
        right = np.minimum(0.55 * down - across, np.minimum(across, 1 - down))
        behind = np.minimum(across + 0.42 * down, np.minimum(-across - 0.03, 0.9 - down))
        colour = blended(colour, rgb("#f3ead7"), 80 * right)
        colour = blended(colour, rgb("#e0a63c"), 80 * behind)
    j, i = np.mgrid[0:h, 0:w] // 2
    weave = 1 + 0.012 * ((i + j) % 2 * 2 - 1)
    return picture(stepped(shrunk(colour, w, h) * weave[..., None], 64))


BOAT = """
............
.....w......
.....ww.....
.....www....
..r..wwww...
..rr.wwwww..
.rrr.w......
....bb......
bbbbbbbbbbb.
.bbbbbbbbb..
ssssssssssss
sSssSssSssSs
"""


def boat() -> Image.Image:
    """A boat of 12 x 12 pixels, each of which is to be seen."""
    paint = {".": "#bfe3f2", "w": "#ffffff", "r": "#d8402f", "b": "#7a4a26", "s": "#2f78b0", "S": "#5fa3d4"}
    return picture(np.array([[rgb(paint[letter]) for letter in row] for row in BOAT.split()]))


TEXTURES: dict[str, Callable[[], Image.Image]] = {
    f.__name__: f for f in (globe, moon, stars, sky, wood, chart, town, painting, boat)
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(TEXTURES)}; all if none is named")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "textures", help="the folder")
    chosen = parser.parse_args()
    for name in set(chosen.names) - set(TEXTURES):
        parser.error(f"there is no {name}; there are {', '.join(TEXTURES)}")
    chosen.output.mkdir(parents=True, exist_ok=True)
    for name in chosen.names or TEXTURES:
        path = chosen.output / f"{name}.png"
        TEXTURES[name]().save(path, optimize=True)
        print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
