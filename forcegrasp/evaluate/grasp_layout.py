"""Where things are in the picture of a grasp; the process that renders needs no more of the figure than this."""

#: Pixels of the picture, and of the scene in its lower left corner.
WIDTH, HEIGHT = 880, 384
SCENE_WIDTH, SCENE_HEIGHT = 400, 336
#: Where the axes begin and end, in pixels from the left and from the top.
LEFT_EDGE, RIGHT_EDGE, TOP_EDGE, BOTTOM_EDGE = 476, 866, 58, 342
