"""The rows of the paper's tables: what each is called, the options of its run, and the paper's own numbers.

A new row, or table, is an entry here; tools/paper_tables.py measures it and writes the page.
"""

FIGURES = ("CD", "NC", "F", "Corr", "cpu_s")


class Size:
    """How large all runs are: options of each, epochs of rows that name none, and the share of those of rows that do."""

    def __init__(self, title, options, epochs, share):
        self.title, self.options, self.epochs, self.share = title, options, epochs, share


SIZES = {"full": Size("Full size", "", 250, 1), "quick": Size("Reduced size (`--quick`)", "--faces 2000", 100, 0.4)}


class Row:
    """A run: what it is called, its options beside the preset, and the paper's CD, NC, F-0.5 %, Corr and seconds for it."""

    def __init__(self, label, options="", paper=None, **special):
        self.label, self.options = label, options
        self.paper = dict(zip(FIGURES, paper or ()))
        self.frames = special.get("frames", 0)      # the first so many of the capture; 0: as the table says
        self.epochs = special.get("epochs", 0)      # 0: as the size says
        self.points = special.get("points", 0)      # a frame; 0: those of the capture
        self.noise = special.get("noise", None)     # Gaussian, in per cent of the diagonal; None: points of the capture
        self.preset = special.get("preset", "paper")
        self.is_base = special.get("base", False)   # what the rows of its group are compared with
        self.group = special.get("group", "")
        self.is_run = special.get("run", True)      # or a row of the paper's numbers alone


class Table:
    def __init__(self, title, about, rows, frames=17, keys=FIGURES[:4]):
        self.title, self.about, self.rows, self.frames, self.keys = title, about, rows, frames, keys


def rotation_rows(epochs, *paper):
    """The three rotations with so many epochs; quaternions, the last, are what the others are compared with."""
    return [Row(f"{epochs} epochs, {name}", f"--rotation {name}", numbers, epochs=epochs, group=epochs, base=name == "quaternion")
            for name, numbers in zip(("cayley", "exponential", "quaternion"), paper)]


def length_rows(frames, *paper):
    """A length in one joint window; in windows with warm starts and without; and with the preset that is ours."""
    joint = Row(f"{frames} frames, joint", "--window 0" if frames > 60 else "", *paper, frames=frames, base=frames == 40)
    windows = "--window 24 --overlap 4"
    return [joint] if frames <= 24 else [
        joint, Row(f"{frames} frames, windows of 24", windows, frames=frames),
        Row(f"{frames} frames, the same without warm start", windows + " --no-warm-start", frames=frames),
        Row(f"{frames} frames, preset grids", "", frames=frames, preset="grids")]


TABLES = {
    "components": Table(
        "Components", "Parts of the method taken out. Paper: DT4D, 17 frames, 1000 epochs.", [
            Row("hash table for grids", "--encoding hash", (1.23, 0.903, 0.947, 0.045)),
            Row("no smoothing of gradients", "--lambda 0", (0.98, 0.955, 0.958, 0.036)),
            Row("no normal grid", "--no-normal-grid", (0.91, 0.968, 0.965, 0.036)),
            Row("no isometry", "--isometry 0", (1.03, 0.961, 0.959, 0.044)),
            Row("the finest grid alone", "--encoding single", (0.98, 0.965, 0.961, 0.036)),
            Row("all", "", (0.87, 0.969, 0.968, 0.034), base=True)]),
    "levels": Table(
        "Levels of the position grid", "Paper: AMA, 17 frames, 1000 epochs.", [
            Row("1", "--grid-levels 1", (1.96, 0.850, 0.810, 0.063)),
            Row("2", "--grid-levels 2", (1.76, 0.859, 0.841, 0.054)),
            Row("4", "--grid-levels 4", (0.54, 0.945, 0.980, 0.023)),
            Row("6", "--grid-levels 6", (0.46, 0.949, 0.987, 0.018)),
            Row("8", "", (0.44, 0.951, 0.989, 0.017), base=True),
            Row("10", "--grid-levels 10", (0.45, 0.951, 0.989, 0.021)),
            Row("12", "--grid-levels 12", (0.46, 0.948, 0.988, 0.024))]),
    "smoothing": Table(
        "Smoothing", "Lambda of the coarsest level, and the matrix, which the paper does not vary. Paper: AMA, 17 frames, "
        "1000 epochs.", [
            Row("lambda 0", "--lambda 0", (0.58, 0.928, 0.977, 0.022)),
            Row("lambda 0.08", "--lambda 0.08", (0.45, 0.950, 0.988, 0.020)),
            Row("lambda 0.4", "", (0.44, 0.951, 0.989, 0.017), base=True),
            Row("lambda 2", "--lambda 2", (0.46, 0.948, 0.986, 0.021)),
            Row("lambda 10", "--lambda 10", (0.50, 0.946, 0.983, 0.025)),
            Row("I + lambda (D - A)", "--smoothing graph"),
            Row("(1 + 6 lambda) I + lambda (D - A)", "--smoothing screened"),
            Row("I + lambda (2 D - A)", "--smoothing doubled")]),
    "time": Table(
        "Time code", "Paper: AMA, 17 frames, 1000 epochs.", [
            Row("polynomial", "--time-code polynomial", (0.46, 0.951, 0.987, 0.019)),
            Row("gaussian", "--time-code gaussian", (0.77, 0.945, 0.979, 0.046)),
            Row("learned", "--time-code learned", (0.50, 0.950, 0.983, 0.022)),
            Row("fourier", "", (0.44, 0.951, 0.989, 0.017), base=True)]),
    "stability": Table(
        "Confidence and catch-up", "How a frame's weight opens with the epochs, and what it is. Paper: AMA, 40 frames.", [
            Row("catch-up constant", "--catch-up constant", (3.22, 0.905, 0.899, 0.114)),
            Row("catch-up linear", "--catch-up linear", (0.60, 0.946, 0.971, 0.025)),
            Row("catch-up exponential", "--catch-up exponential", (0.53, 0.946, 0.982, 0.030)),
            Row("catch-up interpolated", "--catch-up interpolated", (0.64, 0.945, 0.972, 0.046)),
            Row("confidence constant", "--confidence constant", (3.27, 0.905, 0.898, 0.114)),
            Row("confidence delta", "--confidence delta", (2.96, 0.909, 0.908, 0.112)),
            Row("confidence single", "--confidence single", (1.15, 0.931, 0.952, 0.098)),
            Row("catch-up root, confidence cumulative", "", (0.53, 0.947, 0.981, 0.025), base=True)], frames=40),
    "decoder": Table(
        "Decoder", "Sizes of the time code, of the features by normal and by position, and of the hidden layers, and how many "
        "of these there are, which the paper does not vary. Paper: AMA, 40 frames.", [
            Row("time code of 2", "--time-frequencies 1", (0.63, 0.945, 0.970, 0.027)),
            Row("time code of 32", "--time-frequencies 16", (0.64, 0.943, 0.973, 0.040)),
            Row("1 feature by normal", "--normal-channels 1", (0.55, 0.946, 0.979, 0.026)),
            Row("8 by normal (here with 24 by position)", "--position-channels 24 --normal-channels 8",
                (0.57, 0.947, 0.978, 0.026)),
            Row("8 features by position", "--position-channels 8", (0.61, 0.945, 0.975, 0.023)),
            Row("120 features by position (here 32 in all)", paper=(0.59, 0.947, 0.978, 0.032), run=False),
            Row("layers of 128", "--width-1 128 --width-2 128", (0.76, 0.938, 0.959, 0.045)),
            Row("layers of 2048", "--width-1 2048 --width-2 2048", (0.54, 0.948, 0.980, 0.021)),
            Row("1 hidden layer", "--hidden-layers 1"),
            Row("3 hidden layers", "--hidden-layers 3"),
            Row("4 hidden layers", "--hidden-layers 4"),
            Row("8, 2 and 30, two of 512", "", (0.53, 0.947, 0.981, 0.019), base=True)], frames=40),
    "rotation": Table(
        "Rotation", "Compared at each number of epochs. Paper: AMA, 17 frames.",
        rotation_rows(75, (1.96, 0.921, 0.866, 0.047), (1.62, 0.924, 0.886, 0.043), (1.59, 0.923, 0.884, 0.044))
        + rotation_rows(125, (0.72, 0.940, 0.955, 0.029), (0.68, 0.941, 0.961, 0.027), (0.65, 0.942, 0.965, 0.028))
        + rotation_rows(250, (0.52, 0.947, 0.978, 0.021), (0.54, 0.948, 0.976, 0.021), (0.50, 0.948, 0.982, 0.020))
        + rotation_rows(500, (0.47, 0.950, 0.985, 0.019), (0.47, 0.950, 0.985, 0.018), (0.46, 0.950, 0.986, 0.018))
        + rotation_rows(1000, (0.46, 0.950, 0.987, 0.019), (0.45, 0.951, 0.988, 0.017), (0.44, 0.951, 0.988, 0.017))),
    "epochs": Table(
        "Epochs", "Paper: AMA, 17 frames (its table of rotations), then its main table, where seconds are those of a desktop "
        "GPU; here they are processor seconds.", [
            Row("125", "--rotation quaternion", (0.65, 0.942, 0.965, 0.028), epochs=125),
            Row("250", "--rotation quaternion", (0.50, 0.948, 0.982, 0.020), epochs=250, base=True),
            Row("1000", "--rotation quaternion", (0.44, 0.951, 0.988, 0.017), epochs=1000),
            Row("DFAUST, 250", paper=(0.40, 0.967, 0.989, 0.008, 8), run=False),
            Row("DFAUST, 1000", paper=(0.39, 0.968, 0.989, 0.009, 32), run=False),
            Row("DT4D, 250", paper=(0.96, 0.969, 0.962, 0.034, 8), run=False),
            Row("DT4D, 1000", paper=(0.87, 0.969, 0.968, 0.034, 32), run=False),
            Row("AMA, 250", paper=(0.53, 0.946, 0.978, 0.024, 8), run=False),
            Row("AMA, 1000", paper=(0.44, 0.951, 0.988, 0.018, 32), run=False)], keys=FIGURES),
    "lengths": Table(
        "Lengths", "All frames in one joint window, and in windows, which the paper does not have; the preset grids has its own "
        "number of epochs. Paper: AMA; seconds are those of a desktop GPU; here they are processor seconds.",
        length_rows(17, (0.44, 0.951, 0.988, 0.018, 32)) + length_rows(40, (0.53, 0.947, 0.981, 0.019, 47))
        + [Row("60 frames, joint", paper=(0.60, 0.945, 0.976, 0.020, 63), run=False)] + length_rows(72)
        + [Row("80 frames, joint", paper=(1.04, 0.940, 0.959, 0.023, 84), run=False),
           Row("100 frames, joint", paper=(0.95, 0.936, 0.933, 0.024, 97), run=False)]
        + length_rows(120, (1.31, 0.926, 0.887, 0.028, 110)), keys=FIGURES),
    "noise": Table(
        "Noise", "Gaussian, in per cent of the diagonal, with the normals of the surface. Paper: AMA, 17 frames, 1000 epochs.", [
            Row("0 %", "", (0.44, 0.951, 0.988, 0.018), noise=0, base=True),
            Row("0.1 %", "", noise=0.1),
            Row("0.25 %", "", (0.69, 0.925, 0.967, 0.021), noise=0.25),
            Row("0.5 %", "", (1.34, 0.866, 0.853, 0.026), noise=0.5),
            Row("1 %", "", (4.45, 0.681, 0.540, 0.049), noise=1),
            Row("2 %", "", (21.71, 0.517, 0.247, 0.086), noise=2)]),
    "points": Table(
        "Points of a frame", "Paper: AMA, 17 frames, 1000 epochs.", [
            Row("1000", "", points=1000),
            Row("2500", "", (0.75, 0.930, 0.953, 0.022), points=2500),
            Row("5000", "", (0.44, 0.950, 0.988, 0.018), points=5000, base=True),
            Row("10000", "", (0.37, 0.960, 0.995, 0.015), points=10000),
            Row("20000", "", (0.34, 0.968, 0.997, 0.014), points=20000)]),
    "seeds": Table(
        "Seeds", "The same run with other random numbers, so that differences can be judged; the paper has none.", [
            Row("seed 0", "", base=True), Row("seed 1", "--seed 1"), Row("seed 2", "--seed 2")]),
}
