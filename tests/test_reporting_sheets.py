"""Contact sheets: every object at rest once, on the sheet of its source, whether they are few or many."""

import io
import re

import numpy as np
import pandas as pd
import pytest
import trimesh
from PIL import Image

from graspfn.meshes.placed import placed_row, write_placed
from graspfn.reporting.figures import contact_sheet, shading
from graspfn.reporting.figures import objects as sheets
from graspfn.reporting.figures.contact_sheet import HEADING_PX, WIDTH_PX, cells_for, draw_contact_sheet
from graspfn.reporting.figures.style import pdf_bytes, png_bytes
from graspfn.selection.written import Object, write_objects

FEW = [("few_things", f"a_$_thing-{i}", category, split) for i, (category, split) in enumerate(
    [("flower_pot", "train"), ("cup", "train"), ("cup", "test"), ("flower_pot", "train"), ("bowl", "test")]
)]  # fmt: skip
MANY = [("many", f"{i:03d}", f"class_{i % 3}", "train" if i % 4 else "test") for i in range(110)]
LOST = [("lost", "marble", "ball", "test")]
NEVER = "never came to rest in 4 s"
RESTLESS = {"few_things-a_$_thing-3", "lost-marble"}


def an_object(source, name, category, split, size_m):
    box = trimesh.creation.box([size_m, size_m / 2, size_m / 3])
    row = {"id": f"{source}-{name}", "source": source, "name": name, "class": category, "family": category}
    row |= {"licence": "CC0-1.0", "split": split, "shape": f"{source}-{name}", "signature": [0.0], "scale": 1.0}
    row |= {"size_m": size_m, "volume_m3": box.volume, "mass": "volume", "watertight": True, "faces": 12}
    return Object(row | {"collision_faces": 12, "cleaning": "", "seed_index": 0}, box, box)


def write(data, objects):
    for split in ("train", "test"):
        made = [an_object(*names, 0.05 + 0.001 * i) for i, names in enumerate(objects) if names[3] == split]
        write_objects(data / "objects" / split, data / "collision" / split, made)
        rows = []
        for drawn in made:
            T = np.eye(4)
            T[2, 3] = -drawn.mesh.bounds[0, 2]
            status = NEVER if drawn.row["id"] in RESTLESS else "resting"
            rows.append(placed_row(drawn.row["id"], drawn.row["class"], status, T))
        write_placed(data / "placed" / f"{split}.parquet", rows)
    return data


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    (folder / "placed").mkdir()
    return write(folder, FEW + MANY + LOST)


@pytest.fixture(scope="module")
def drawn(data):
    """Every plate by its name, and the ids that were read for it, in order."""
    read, plates = [], {}
    patch = pytest.MonkeyPatch()
    patch.setattr(shading, "SAMPLES", 1)
    load = sheets.load_placed
    patch.setattr(sheets, "load_placed", lambda folder, row: read.append((folder.name, row["id"])) or load(folder, row))
    for plate in sheets.contact_sheets(data):
        plates[plate.name] = plate, read.copy()
        read.clear()
    patch.undo()
    return plates


def words(figure):
    return [text.get_text() for text in figure.axes[0].texts]


def canvas(figure):
    (image,) = figure.axes[0].images
    return np.asarray(image.get_array())


def test_every_object_at_rest_is_drawn_once_on_the_sheet_of_its_source(drawn):
    assert list(drawn) == ["objects_few_things", "objects_many"]
    for (_, read), objects in zip(drawn.values(), (FEW, MANY), strict=True):
        expected = [
            (split, f"{source}-{name}")
            for source, name, category, split in sorted(objects, key=lambda o: (o[3] == "test", o[2], o[1]))
            if f"{source}-{name}" not in RESTLESS
        ]
        assert read == expected


@pytest.mark.parametrize(("name", "counts"), [("objects_few_things", (2, 2)), ("objects_many", (82, 28))])
def test_every_cell_holds_a_picture_of_an_object_and_all_else_is_paper(drawn, name, counts):
    picture = canvas(drawn[name][0].figure).astype(int)
    cells = cells_for([("", ["x"] * sum(counts))])
    orange = picture[..., 0] - picture[..., 2] > 60
    left, top = orange.copy(), 0
    for count in counts:
        top += HEADING_PX
        for i in range(count):
            row, column = divmod(i, cells.columns)
            x, y = column * cells.pitch_px, top + row * cells.height_px
            place = np.s_[y : y + cells.side_px, x : x + cells.side_px]
            assert orange[place].sum() > 20 and orange[place].mean() < 0.5
            left[place] = False
        top += -(-count // cells.columns) * cells.height_px
    assert picture.shape[0] == top and not left.any()


def test_few_are_named_and_many_are_not(drawn):
    few, many = words(drawn["objects_few_things"][0].figure), words(drawn["objects_many"][0].figure)
    assert few == [
        "Training objects (2)",
        "a $ thing 1",
        "a $ thing 0",
        "Test objects (2)",
        "a $ thing 4",
        "a $ thing 2",
    ]
    assert many == ["Training objects (82)", "Test objects (28)"]


def test_captions_say_how_many_in_which_order_and_what_is_missing(drawn):
    few, many = (plate.caption for plate, _ in drawn.values())
    assert "2 to train on, 2 to test on" in few and "Left out and not shown: 1 never came to rest in 4 s" in few
    assert "82 to train on, 28 to test on" in many and "never" not in many
    assert many.endswith("In the order of their classes: class 0, class 1, class 2.")
    assert "class" not in few


def test_the_same_objects_give_the_same_bytes(data, drawn, monkeypatch):
    monkeypatch.setattr(shading, "SAMPLES", 1)
    for plate in sheets.contact_sheets(data):
        first = drawn[plate.name][0]
        assert plate.caption == first.caption
        assert png_bytes(plate.figure, plate.palette) == png_bytes(first.figure, first.palette)
        assert pdf_bytes(plate.figure) == pdf_bytes(first.figure)


def test_a_file_shows_the_pictures_pixel_by_pixel(drawn):
    plate = drawn["objects_many"][0]
    image = np.asarray(Image.open(io.BytesIO(png_bytes(plate.figure))).convert("RGB"))
    assert image.shape == canvas(plate.figure).shape
    different = np.flatnonzero((image != canvas(plate.figure)).any(axis=(1, 2)))
    assert len(different) < 2 * HEADING_PX  # the rows of the headings
    small = png_bytes(plate.figure, palette=True)
    assert len(small) < len(png_bytes(plate.figure))
    restored = np.asarray(Image.open(io.BytesIO(small)).convert("RGB"))
    assert np.abs(restored.astype(int) - image).max() < 40 and np.abs(restored.astype(int) - image).mean() < 1


def test_the_pdf_holds_one_image_with_a_palette(drawn):
    pdf = pdf_bytes(drawn["objects_many"][0].figure)
    assert len(re.findall(rb"/Subtype\s*/Image", pdf)) == 1 and b"/Indexed" in pdf


@pytest.mark.parametrize("counts", [(1,), (3, 2), (100,), (57, 44), (1000, 200)])
def test_no_picture_covers_another_whatever_their_number(counts, monkeypatch):
    monkeypatch.setattr(contact_sheet, "few_colours", lambda picture: picture)
    groups = [(f"heading {i}", ["a name"] * count) for i, count in enumerate(counts)]
    cells = cells_for(groups)
    colours = np.arange(sum(counts)) * 7
    pictures = (np.full((cells.side_px, cells.side_px, 3), (c % 256, c // 256, 0), np.uint8) for c in colours)
    figure = draw_contact_sheet(groups, cells, pictures)
    found = canvas(figure).astype(int)
    assert found.shape[1] == WIDTH_PX
    code = np.where(found[..., 2] == 255, -1, found[..., 0] + 256 * found[..., 1])
    values, pixels = np.unique(code[code >= 0], return_counts=True)
    assert values.tolist() == colours.tolist() and (pixels == cells.side_px**2).all()


@pytest.mark.parametrize(
    "name", ["cup", "a_hyphen-rich-name-of-a-thing", "x" * 60, "airplane-0007", "wood block " * 9, ""]
)
def test_a_name_takes_two_lines_at_most_and_no_more_than_its_column(name):
    cells = cells_for([("", ["x"] * 100)])
    lines = cells.wrapped(name)
    assert len(lines) <= 2 and all(len(line) * 9.6 <= cells.side_px for line in lines)
    shown = re.sub(r"[_ -]", "", name)
    assert shown == "".join(lines).replace(" ", "") or lines[-1].endswith("…")


def test_one_scale_and_the_object_in_the_middle():
    def size_px(size_m, at):
        box = trimesh.creation.box([size_m] * 3)
        T = trimesh.transformations.translation_matrix([at, -at, size_m / 2])
        image = sheets.picture(box, T, 0.3, 90).astype(int)
        rows, columns = np.nonzero(image[..., 0] - image[..., 2] > 60)
        assert np.abs([rows.min() + rows.max() - 89, columns.min() + columns.max() - 89]).max() < 12
        return np.ptp(columns)

    assert size_px(0.16, 0.0) == pytest.approx(2 * size_px(0.08, 0.2), rel=0.12)
    assert size_px(0.2, 0.1) < 89  # a cube, with the longest diagonals that its extent allows, fits


def test_objects_that_were_never_placed_are_left_out_like_the_restless(tmp_path, monkeypatch):
    monkeypatch.setattr(shading, "SAMPLES", 1)
    (tmp_path / "placed").mkdir()
    write(tmp_path, FEW)
    for split in ("train", "test"):
        path = tmp_path / f"placed/{split}.parquet"
        pd.read_parquet(path).head(1).to_parquet(path, index=False)
    (plate,) = sheets.contact_sheets(tmp_path)
    assert "1 to train on, 1 to test on" in plate.caption and "not shown: 3 not placed" in plate.caption
