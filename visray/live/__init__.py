"""The live picture: a scene in the browser, which turns under the mouse and follows sliders."""
