"""Map files in every mode: pixels by hand, the quirks of files in circulation, and what cannot be read."""

import io
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from chefbotd.components.maps.algorithms.map_server import (
    ImageMode,
    MapDescription,
    MapFileError,
    parse_description,
    parse_image,
    to_description,
    to_image,
)
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid

YAML = """\
image: flat.pgm
resolution: 0.050000
origin: [-12.200000, 3.500000, 0.000000]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196

"""


def describe(**changes: object) -> MapDescription:
    """A description with some keys changed."""
    values = {"image": "flat.pgm", "resolution": 0.05, "origin": (-1.0, 2.0, 0.5), **changes}
    return MapDescription.model_validate(values)


def pgm(rows: list[list[int]], comment: bytes = b"") -> bytes:
    """A PGM file of these shades, the top row first."""
    return b"P5\n%b%d %d\n255\n%b" % (comment, len(rows[0]), len(rows), bytes(v for row in rows for v in row))


def png(pixels: np.ndarray, mode: str) -> bytes:
    """A PNG file of these pixels."""
    data = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint8), mode=mode).save(data, format="PNG")
    return data.getvalue()


def test_a_description_is_read_as_map_saver_writes_it() -> None:
    """Six keys and an empty line; the mode is trinary where none is named."""
    description = parse_description(YAML, "flat.yaml")
    assert description == MapDescription(
        image="flat.pgm", resolution=0.05, origin=(-12.2, 3.5, 0.0), occupied_thresh=0.65, free_thresh=0.196
    )
    assert description.mode is ImageMode.TRINARY


def test_the_first_row_of_the_image_is_the_top_of_the_map() -> None:
    """Occupied at the lower left corner, free at the upper right: rows grow with y."""
    grid = parse_image(pgm([[205, 254, 254], [0, 205, 254]]), describe())
    assert grid.percent.tolist() == [[100, -1, 0], [-1, 0, 0]]
    assert grid.resolution_m == 0.05
    assert grid.map_from_grid == Pose2D(-1.0, 2.0, 0.5)


def test_grey_205_is_unknown_below_a_threshold_of_0_196_and_free_below_0_25() -> None:
    """Its occupancy is 50 / 255 = 0.19608: by the letter, a file with Nav2's 0.25 calls it free."""
    image = pgm([[205]])
    assert parse_image(image, describe(free_thresh=0.196)).percent.item() == -1
    assert parse_image(image, describe(free_thresh=0.25)).percent.item() == 0


def test_a_comment_in_the_image_s_heading_is_passed_over() -> None:
    """Map generators sign their files so."""
    image = pgm([[0, 254]], b"# CREATOR: Map_generator.cpp 0.050 m/pix\n")
    assert parse_image(image, describe()).percent.tolist() == [[100, 0]]


def test_negate_makes_white_occupied() -> None:
    """254 is occupied, 0 free; 50 is 0.19608 occupied, so unknown."""
    assert parse_image(pgm([[254, 0, 50]]), describe(negate=1)).percent.tolist() == [[100, 0, -1]]


def test_a_shade_on_a_threshold_is_between_them() -> None:
    """Occupancy 0.2 of shade 204 is neither above nor below a threshold of 0.2."""
    assert parse_image(pgm([[204]]), describe(free_thresh=0.2)).percent.item() == -1


def test_a_scale_runs_from_the_one_threshold_to_the_other() -> None:
    """Thresholds 0.2 and 0.6: shade 153 is 0.4 occupied, half of the way; above and below it is 100 and 0."""
    changes = {"mode": "scale", "free_thresh": 0.2, "occupied_thresh": 0.6}
    assert parse_image(pgm([[153, 0, 255]]), describe(**changes)).percent.tolist() == [[50, 100, 0]]


def test_transparent_pixels_are_unknown_on_a_scale() -> None:
    """Also partly transparent ones, and whatever their shade."""
    pixels = np.array([[[0, 255], [0, 0], [255, 254]]])
    grid = parse_image(png(pixels, "LA"), describe(image="flat.png", mode="scale"))
    assert grid.percent.tolist() == [[100, -1, -1]]


def test_raw_pixels_are_percent_and_beyond_100_unknown() -> None:
    """Thresholds play no part."""
    assert parse_image(pgm([[0, 37, 100, 101, 255]]), describe(mode="raw")).percent.tolist() == [
        [0, 37, 100, -1, -1]
    ]


def test_colours_are_averaged() -> None:
    """Red of 150 with black is shade 50, so 0.80 occupied; of 255 it is 85, 0.67; of (255, 255, 100) 203, 0.20."""
    pixels = np.array([[[150, 0, 0], [255, 0, 0], [255, 255, 100]]])
    grid = parse_image(png(pixels, "RGB"), describe(free_thresh=0.21))
    assert grid.percent.tolist() == [[100, 100, 0]]


def test_a_trinary_map_averages_the_transparency_in() -> None:
    """Opaque black is (0 + 0 + 0 + 255) / 4 = 63.75, 0.75 occupied; fully transparent black 1.0."""
    pixels = np.array([[[0, 0, 0, 255], [0, 0, 0, 0]]])
    assert parse_image(png(pixels, "RGBA"), describe(occupied_thresh=0.8)).percent.tolist() == [[-1, 100]]


GRIDS = st.builds(
    lambda rows, columns, data, resolution, x, y, yaw: OccupancyGrid(
        resolution, Pose2D(x, y, yaw), np.array(data[: rows * columns], np.int8).reshape(rows, columns)
    ),
    st.integers(1, 5),
    st.integers(1, 6),
    st.lists(st.integers(-1, 100), min_size=30, max_size=30),
    st.sampled_from([0.05, 0.025, 0.1]),
    st.floats(-100, 100),
    st.floats(-100, 100),
    st.floats(-math.pi, math.pi),
)


@given(GRIDS, st.sampled_from([ImageMode.SCALE, ImageMode.RAW]))
def test_a_scale_and_a_raw_map_keep_every_percent(grid: OccupancyGrid, mode: ImageMode) -> None:
    """Written and read again: cells, resolution and origin."""
    description = parse_description(to_description(grid, "m.png", mode), "m.yaml")
    again = parse_image(to_image(grid, mode), description)
    assert np.array_equal(again.percent, grid.percent)
    assert (again.resolution_m, again.map_from_grid) == (grid.resolution_m, grid.map_from_grid)


@given(GRIDS)
def test_a_trinary_map_keeps_free_occupied_and_unknown(grid: OccupancyGrid) -> None:
    """Up to 19 percent is free, from 65 occupied, and all else unknown."""
    again = parse_image(to_image(grid), parse_description(to_description(grid, "m.pgm"), "m.yaml"))
    expected = [
        [-1 if p == -1 or 19 < p < 65 else 100 if p >= 65 else 0 for p in row]
        for row in grid.percent.tolist()
    ]
    assert again.percent.tolist() == expected


def test_a_map_is_written_with_map_saver_s_shades_and_thresholds() -> None:
    """0, 205 and 254, the top row first; thresholds with which 205 stays unknown."""
    grid = OccupancyGrid(0.05, Pose2D(-1.0, 2.0, 0.0), np.array([[100, -1], [0, 100]], np.int8))
    assert to_image(grid) == b"P5\n2 2\n255\n" + bytes([254, 0, 0, 205])
    assert to_description(grid, "flat.pgm").splitlines() == [
        "image: flat.pgm",
        "mode: trinary",
        "resolution: 0.05",
        "origin: [-1.0, 2.0, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("image: [", "flat.yaml: not valid YAML"),
        ("- 1", "flat.yaml: a map's YAML is keys and values, got list"),
        ("", "flat.yaml: a map's YAML is keys and values, got NoneType"),
        ("image: a.pgm\nresolution: 0.05", "flat.yaml: origin: Field required"),
        (
            YAML.replace("0.050000", "0"),
            r"resolution: Input should be greater than or equal to 0.001 \(got 0\)",
        ),
        (
            YAML.replace("0.65", "1.5"),
            r"occupied_thresh: Input should be less than or equal to 1 \(got 1.5\)",
        ),
        (YAML.replace("-12.200000", "-nan"), r"origin.0: Input should be a finite number \(got '-nan'\)"),
        (YAML + "mode: colour", "mode: Input should be 'trinary', 'scale' or 'raw'"),
        (YAML.replace("3.500000, ", ""), r"origin.2: Field required"),
    ],
)
def test_a_description_that_is_none_is_refused_by_name(text: str, told: str) -> None:
    """The message has the file, the key, the value and what was expected."""
    with pytest.raises(MapFileError, match=told):
        parse_description(text, "flat.yaml")


@pytest.mark.parametrize("mode", ["Trinary", "TRINARY", "Scale", "RAW"])
def test_a_mode_is_read_in_whatever_case(mode: str) -> None:
    """Nav2 makes it lower case before it looks."""
    assert parse_description(f"{YAML}mode: {mode}\n", "flat.yaml").mode == mode.lower()


def test_a_tab_between_values_is_a_space() -> None:
    """yaml-cpp reads such files, as editors write them; PyYAML says that no token begins so."""
    text = YAML.replace(": ", ":\t").replace(", ", ",\t") + "\t\n"
    assert parse_description(text, "flat.yaml") == parse_description(YAML, "flat.yaml")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16"])
def test_a_comment_may_be_in_whatever_encoding(encoding: str) -> None:
    """An umlaut is no UTF-8 in a file of an older Windows, and PowerShell's ``>`` writes UTF-16."""
    content = f"# Küche, 2. Stock\n{YAML}".encode(encoding)
    assert parse_description(content, "flat.yaml") == parse_description(YAML, "flat.yaml")


@pytest.mark.parametrize("thresh", [0.2, 0.5])
def test_with_equal_thresholds_only_a_shade_on_them_is_unknown(thresh: float) -> None:
    """Map_server asks whether a pixel is above the one, then whether it is below the other: 204 is 0.2, 127.5 is 0.5."""
    image, on = pgm([[0, 204, 254]]), describe(occupied_thresh=thresh, free_thresh=thresh)
    assert parse_image(image, on).percent.tolist() == [[100, -1 if thresh == 0.2 else 0, 0]]
    scale = describe(occupied_thresh=thresh, free_thresh=thresh, mode="scale")
    assert parse_image(image, scale).percent.tolist() == [[100, -1 if thresh == 0.2 else 0, 0]]


def test_with_thresholds_in_the_wrong_order_occupied_is_asked_first() -> None:
    """Thresholds 0.1 and 0.6: shade 204 is 0.2 occupied, which is above the one and below the other: a wall."""
    swapped = describe(occupied_thresh=0.1, free_thresh=0.6)
    assert parse_image(pgm([[0, 204, 254]]), swapped).percent.tolist() == [[100, 100, 0]]


@pytest.mark.parametrize(("negate", "read"), [("0", 0), ("1", 1), ("2", 1), ("true", 1), ("false", 0)])
def test_any_number_but_0_negates(negate: str, read: int) -> None:
    """As a condition in C has it; Nav2 reads a word."""
    assert parse_description(YAML.replace("negate: 0", f"negate: {negate}"), "flat.yaml").negate == read


@pytest.mark.parametrize("yaw", ["-nan", "nan", ".nan", ".NaN", "NaN"])
def test_a_yaw_that_is_no_number_is_no_turn_and_is_said(yaw: str) -> None:
    """What map_saver writes where a program's map had a quaternion of zeros."""
    description = parse_description(YAML.replace("3.500000, 0.000000", f"3.500000, {yaw}"), "flat.yaml")
    assert description.origin == (-12.2, 3.5, 0.0)
    assert "yaw" in description.notes[0]
    assert parse_description(YAML, "flat.yaml").notes == ()


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 147472\n"


def test_a_pointer_of_git_lfs_is_named_as_one() -> None:
    """In place of the image, and of the YAML file: with what to run."""
    with pytest.raises(MapFileError, match=r"flat\.pgm: is only a pointer of Git LFS.*git lfs pull"):
        parse_image(POINTER, describe())
    with pytest.raises(MapFileError, match=r"flat\.yaml: is only a pointer of Git LFS.*git lfs pull"):
        parse_description(POINTER, "flat.yaml")


def test_keys_that_are_nobody_s_are_passed_over() -> None:
    """As map_server passes over them: other tools keep theirs there."""
    text = YAML + "cost_translation_table: {}\nnotes: [mine]\n"
    assert parse_description(text, "flat.yaml") == parse_description(YAML, "flat.yaml")


@pytest.mark.parametrize("data", [b"", b"P5\n3 3\n255\n12", b"<html>", b"P5\n99999 99999\n255\n"])
def test_an_image_that_is_none_is_refused_by_name(data: bytes) -> None:
    """Empty, cut short, something else, or larger than any map."""
    with pytest.raises(MapFileError, match=r"flat\.pgm: "):
        parse_image(data, describe())


def test_a_grid_is_checked_when_it_is_made() -> None:
    """Its shape, its type, its range and its resolution."""
    cells = np.zeros((2, 2), np.int8)
    for resolution_m, percent, told in (
        (0.0, cells, "above 0 m, got 0.0"),
        (0.05, cells.astype(np.uint8), "got uint8 of shape"),
        (0.05, cells[0], r"int8 of shape \(2,\)"),
        (0.05, np.full((2, 2), 101, np.int8), "from -1 to 100, got 101 to 101"),
    ):
        with pytest.raises(ValueError, match=told):
            OccupancyGrid(resolution_m, Pose2D(), percent)


@pytest.mark.parametrize("resolution", ["1e-320", "1e300", "1e-9", "1000"])
def test_cells_that_no_map_has_are_refused(resolution: str) -> None:
    """From 1 mm to 10 m: what is beside that is a mistake, and would end who plans on it."""
    text = f"image: a.pgm\nresolution: {resolution}\norigin: [0, 0, 0]\n".replace("e3", ".0e+3")
    text = text.replace("1e-", "1.0e-")
    with pytest.raises(MapFileError, match="resolution"):
        parse_description(text, "a.yaml")


def test_aliases_are_refused_at_once() -> None:
    """A list of lists of lists, each nine times: a billion texts in 400 bytes."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 9)]
    with pytest.raises(MapFileError, match="aliases"):
        parse_description("\n".join(lines), "a.yaml")
