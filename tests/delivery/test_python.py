"""The Python module, installed, on a small sample capture.  Run by tests/python.bats; argv: a folder to work in."""

import ctypes
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
import unittest

import numpy as np

import neupig
from neupig import _library

WORK = pathlib.Path(sys.argv.pop(1))
SMALL = dict(epochs=6, faces=600, poisson_depth=4, bars="residual=100,coverage=0,flipped=100")


def ball(frame, count=900):
    """A ball of 1 m, 4 cm further in every frame, far from the origin."""
    i = np.arange(count)
    z = 1 - 2 * (i + 0.5) / count
    turn = i * 2.399963229728653 + 0.7 * frame
    normals = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    return normals + centre(frame), normals.astype(np.float32)


def centre(frame):
    return np.array([431000.25 + 0.04 * frame, 5412000.5, 120.0])


class Files(unittest.TestCase):
    """Files in, files out, on the sample capture: a walking figure with noise and outliers, without normals."""

    @classmethod
    def setUpClass(cls):
        cls.capture = neupig.synth(WORK / "capture", frames=4, points=900, noise=0.1, outliers=0.5, normals=False)
        cls.told = []
        cls.outcome = neupig.run(cls.capture.points, WORK / "out", progress=cls.told.append, **SMALL)

    def test_run_leaves_meshes_that_load_as_arrays(self):
        self.assertIn(self.outcome.status, (neupig.Status.OK, neupig.Status.PARTIAL))
        self.assertEqual(self.outcome.done["frames"], 4)
        self.assertTrue(self.told and 0 <= self.told[-1].share <= 1)
        motion = neupig.load(WORK / "out")
        self.assertEqual(motion.vertices.shape[0], 4)
        self.assertEqual(motion.vertices.dtype, np.float64)
        self.assertLess(motion.faces.max(), motion.vertices.shape[1])
        reference = neupig.read_mesh(WORK / "out" / "reference.ply")
        np.testing.assert_array_equal(reference.faces, motion.faces)
        self.assertTrue(np.isfinite(motion.residuals).all())

    def test_a_second_start_has_nothing_left_to_do(self):
        before = (WORK / "out" / "done.json").stat().st_mtime_ns
        neupig.run(self.capture.points, WORK / "out", **SMALL)
        self.assertEqual((WORK / "out" / "done.json").stat().st_mtime_ns, before)

    def test_eval_probe_apply_render(self):
        figures = neupig.eval(WORK / "out", self.capture.truth, samples=2000)
        self.assertEqual(figures["frames"], 4)
        self.assertLess(figures["CD"], 500)
        self.assertEqual(neupig.probe(self.capture.points)["points"]["total"], 3600)
        folder = neupig.apply(WORK / "out", WORK / "out" / "reference.ply", WORK / "carried")
        self.assertEqual(len(list(folder.glob("frame_*.ply"))), 4)
        self.assertEqual(neupig.export(WORK / "out", ["npz", "pc2"]), 3)
        self.assertEqual(neupig.export(WORK / "out", "npz"), 0)
        arrays = np.load(WORK / "out" / "motion.npz")
        np.testing.assert_allclose(arrays["vertices"], neupig.load(WORK / "out").vertices, atol=1e-6)
        self.assertEqual(len(figures["per_frame"]), 4)
        self.assertGreater(figures["Corr"], 0)
        picture = neupig.render(WORK / "out" / "meshes", WORK / "strip.png", height=64, samples=1)
        self.assertEqual(picture.read_bytes()[:4], b"\x89PNG")

    def test_append_goes_on_with_frames_that_came_later(self):
        frames = sorted(self.capture.points.glob("*.ply"))
        some = WORK / "some"
        some.mkdir()
        for frame in frames[:3]:
            (some / frame.name).write_bytes(frame.read_bytes())
        neupig.run(some, WORK / "grown", **SMALL)
        (some / frames[3].name).write_bytes(frames[3].read_bytes())
        with self.assertRaises(neupig.Error) as caught:
            neupig.run(some, WORK / "grown", **SMALL)
        self.assertIs(caught.exception.status, neupig.Status.USAGE)
        neupig.append(WORK / "grown")
        self.assertEqual(len(neupig.load(WORK / "grown").numbers), 4)

    def test_ctrl_c_stops_a_run_in_good_order(self):
        words = ("import neupig, sys\n"
                 "neupig.run(sys.argv[1], sys.argv[2], align=\"no\", epochs=1000000, progress=lambda p: print(p.step, flush=True))\n")
        # the first two while the main thread has not begun to wait
        for i, (delay, times) in enumerate([(0, 1), (0, 2), (0.01, 1), (0.3, 2)]):
            output = WORK / f"stopped{i}"
            child = subprocess.Popen([sys.executable, "-c", words, str(self.capture.points), str(output)],
                                     stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            child.stdout.readline()
            for _ in range(times):
                time.sleep(delay)
                child.send_signal(signal.SIGINT)
            _, said = child.communicate(timeout=60)
            self.assertEqual(child.returncode, -signal.SIGINT, said)
            self.assertIn("KeyboardInterrupt", said)
            self.assertFalse((output / "done.json").exists())

    def test_a_run_closed_while_another_thread_waits(self):
        run = neupig.Run(input=self.capture.points, output=WORK / "closed", align="no", epochs=1000000)
        said = []

        def wait():
            try:
                run.wait()
            except neupig.Error as error:
                said.append(error.status)

        thread = threading.Thread(target=wait)
        thread.start()
        time.sleep(0.2)
        run.close()
        thread.join(60)
        self.assertIn(said, ([], [neupig.Status.STOPPED], [neupig.Status.USAGE]))
        self.assertFalse(thread.is_alive())
        with self.assertRaises(neupig.Error):
            run.wait()


class Arrays(unittest.TestCase):
    def test_reconstruct(self):
        motion = neupig.reconstruct((ball(t) for t in range(4)), **SMALL)
        self.assertEqual(list(motion.numbers), [0, 1, 2, 3])
        for t in range(4):
            radius = np.linalg.norm(motion.vertices[t] - centre(t), axis=1)
            self.assertLess(np.abs(radius - 1).max(), 0.15)
        self.assertGreater(motion.coverages.min(), 0.9)
        self.assertTrue(motion.good.all())

    def test_push_and_pull(self):
        with neupig.Run(pull=True, **SMALL) as run:
            def film():
                for t in range(4):
                    run.push(*ball(t), number=10 + t)
                run.finish()
            thread = threading.Thread(target=film)
            thread.start()
            numbers = sorted(mesh.number for mesh in run)
            thread.join()
            self.assertEqual(numbers, [10, 11, 12, 13])
            self.assertIn(run.wait(), (neupig.Status.OK, neupig.Status.PARTIAL))

    def test_pushed_frames_are_kept(self):
        options = dict(SMALL, window=3, overlap=1, look_ahead=4)
        output = WORK / "pushed"
        with neupig.Run(output=output, **options) as run:
            self.assertIsNone(run.wanted_number())
            for t in range(9):
                run.push(*ball(t), number=10 + t)
            store = output / "job" / "store.npg"
            while not store.exists() or b"NPGREC01state" not in store.read_bytes():
                time.sleep(0.02)
        with neupig.Run(output=output, **options) as run:
            wanted = run.wanted_number()
            self.assertGreaterEqual(wanted, 10)
            for t in range(wanted - 10, 9):
                run.push(*ball(t), number=10 + t)
            run.finish()
            self.assertIn(run.wait(), (neupig.Status.OK, neupig.Status.PARTIAL))
        self.assertEqual(len(list((output / "meshes").iterdir())), 9)

    def test_colours_go_in_and_come_out(self):
        def painted(frame):  # red above, green below; blue says the frame
            points, normals = ball(frame)
            above = points[:, 2] > 120
            return points, normals, np.stack([200 * above, 200 * ~above, np.full(len(points), 40 * frame)], 1).astype(np.uint8)

        seen = []

        def watch(frame):
            seen.append(int(frame.colours[:, 2].max()))

        stage = neupig.Stage("watch", "evaluate", watch)
        motion = neupig.reconstruct((painted(t) for t in range(3)), stages=[stage], colour="frames", **SMALL)
        self.assertEqual(motion.colours.shape, motion.vertices.shape[:2] + (4,))
        self.assertEqual(sorted(seen), [0, 40, 80])
        for t in range(3):
            height = motion.vertices[t][:, 2] - 120
            self.assertGreater(motion.colours[t][height > 0.3, 0].min(), 150)
            self.assertGreater(motion.colours[t][height < -0.3, 1].min(), 150)
            self.assertEqual(np.median(motion.colours[t][:, 2]), 40 * t)
        one = neupig.reconstruct((painted(t) for t in range(2)), **SMALL)
        self.assertEqual(one.colours.shape, (one.vertices.shape[1], 4))
        self.assertIsNone(neupig.reconstruct((painted(t) for t in range(2)), colour="no", **SMALL).colours)
        with neupig.Run(pull=True, **SMALL) as run:
            with self.assertRaises(neupig.Error) as caught:
                run.push(*ball(0), np.zeros((900, 2), np.uint8), number=0)
            self.assertIs(caught.exception.status, neupig.Status.USAGE)

    def test_a_stage_of_ones_own_sees_and_drops_points(self):
        seen = []

        def upper_half(frame):
            y = frame.points_origin[1] + frame.points[:, 1]
            frame.keep[:] = y > centre(0)[1] - 0.5
            seen.append(len(frame.points))

        def watch(frame):
            seen.append((frame.vertices.shape, frame.faces.shape, frame.coverage > 0))

        stages = [neupig.Stage("upper", "ingest", upper_half), neupig.Stage("watch", "evaluate", watch)]
        motion = neupig.reconstruct((ball(t) for t in range(3)), stages=stages, **SMALL)
        self.assertIn(900, seen)
        self.assertIn((motion.vertices.shape[1:], motion.faces.shape, True), seen)
        self.assertGreater(motion.vertices[..., 1].min(), centre(0)[1] - 0.9)

    def test_what_a_stage_raises_is_raised_again(self):
        def broken(_frame):
            raise ZeroDivisionError("mine")
        with self.assertRaises(ZeroDivisionError):
            neupig.reconstruct((ball(t) for t in range(3)), stages=[neupig.Stage("broken", "ingest", broken)], **SMALL)

    def test_what_the_frames_raise_is_raised_again(self):
        def frames():
            yield ball(0)
            raise LookupError("camera")
        with self.assertRaises(LookupError):
            neupig.reconstruct(frames(), **SMALL)
        with self.assertRaisesRegex(neupig.Error, "N x 3"):
            neupig.reconstruct([np.zeros((5, 2))], **SMALL)

    def test_surface(self):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
        with neupig.Surface(vertices, [[0, 1, 2]]) as surface:
            hits = surface.closest([[0.25, 0.25, 2], [np.nan, 0, 0]])
            self.assertEqual(hits.distances[0], 2)
            np.testing.assert_allclose(hits.weights[0], [0.5, 0.25, 0.25])
            self.assertEqual((hits.faces[1], hits.distances[1]), (2**32 - 1, np.inf))
            surface.move(vertices + [0, 0, 1])
            self.assertEqual(surface.closest([[0.25, 0.25, 2]]).distances[0], 1)
        with self.assertRaises(neupig.Error):
            surface.closest([[0, 0, 0]])


class Failures(unittest.TestCase):
    def check(self, status, words, call):
        with self.assertRaises(neupig.Error) as caught:
            call()
        self.assertIs(caught.exception.status, status)
        self.assertIn(words, caught.exception.message)

    def test_they_carry_status_and_words(self):
        self.check(neupig.Status.BAD_INPUT, "nowhere", lambda: neupig.run("/nowhere", WORK / "x"))
        self.check(neupig.Status.USAGE, "no option flavour", lambda: neupig.run("/nowhere", WORK / "x", flavour=1))
        self.check(neupig.Status.USAGE, "no option keep_gong; did you mean keep_going?",
                   lambda: neupig.run("/nowhere", WORK / "x", keep_gong=True))
        self.check(neupig.Status.USAGE, "did you mean progress?", lambda: neupig.run("/nowhere", WORK / "x", progres=print))
        self.check(neupig.Status.USAGE, "did you mean samples?", lambda: neupig.eval("/nowhere", "/nowhere", sample=3))
        self.check(neupig.Status.USAGE, "did you mean fps_scale?", lambda: neupig.apply("/n", "/n", "/n", fps_scle=3))
        self.check(neupig.Status.USAGE, "not the output folder", lambda: neupig.export("/nowhere", "glb"))
        self.check(neupig.Status.USAGE, "epochs", lambda: neupig.run("/nowhere", WORK / "x", epochs="many"))
        self.check(neupig.Status.BAD_INPUT, "nowhere", lambda: neupig.eval("/nowhere", "/nowhere"))
        self.check(neupig.Status.USAGE, "holds no job", lambda: neupig.append(WORK / "x"))
        self.check(neupig.Status.USAGE, "--fames", lambda: neupig.synth(WORK / "x", fames=3))
        self.check(neupig.Status.USAGE, "faces must be", lambda: neupig.Surface([[0, 0, 0]], [0, 1, 2]))
        self.check(neupig.Status.BAD_INPUT, "no run that is done", lambda: neupig.load(WORK / "x"))

    def test_a_closed_run_says_so(self):
        run = neupig.Run(pull=True)
        run.close()
        run.close()
        run.stop()
        for call in (run.wait, run.pull, run.finish, lambda: run.push(*ball(0), number=0)):
            self.check(neupig.Status.USAGE, "closed", call)

    def test_every_option_is_listed(self):
        options = {option.name: option for option in neupig.options()}
        self.assertEqual(options["method"].choices, ("default", "paper", "paper-1000", "grids"))
        self.assertEqual(options["seed"].type, "int")
        self.assertEqual(options["epochs"].use, "method")
        help_run = json.loads(subprocess.run([os.environ["NEUPIG"], "help", "run", "--json"], check=True, capture_output=True).stdout)
        shown = {option["name"] for option in help_run["options"]}
        self.assertEqual({name for name, option in options.items() if option.use == "command"} - shown, set())
        self.assertEqual(neupig.Options({"keep_going": True}).get("keep-going"), "yes")

    def test_nothing_stays_behind(self):
        self.assertEqual(_library.lib.npg_memory_used(), 0)


class Border(unittest.TestCase):
    """The structs as the header has them; argv of this program: what a C program says of their sizes."""

    def test_struct_sizes(self):
        for line in os.environ["NEUPIG_SIZES"].split():
            name, size = line.split("=")
            self.assertEqual(ctypes.sizeof(getattr(_library, name)), int(size), name)

    def test_status_values(self):
        for line in os.environ["NEUPIG_STATUS"].split():
            name, value = line.split("=")
            self.assertEqual(neupig.Status[name], int(value))


if __name__ == "__main__":
    unittest.main(verbosity=2)
