"""What training shows while it runs: TensorBoard, metrics.csv, figures and videos."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

import torch
from tensordict import TensorDictBase
from torch.utils.tensorboard import SummaryWriter

from forcegrasp.config import TrainConfig
from forcegrasp.errors import CheckpointError
from forcegrasp.evaluate.colours import policy_colours
from forcegrasp.evaluate.plots import force_traces
from forcegrasp.evaluate.video import grasp_video
from forcegrasp.physics import load_gripper
from forcegrasp.physics.scene_renderer import NoRendererError
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.algorithms import algorithm_of
from forcegrasp.train.board import card, layout, tag

#: Episodes drawn in a figure of force traces.
TRACES = 6


class TrainingLog:
    """Writes one batch's metrics under TensorBoard's tags and into metrics.csv. A context manager.

    Raises:
      CheckpointError: where the disk is full or not writable; the run's checkpoints are as they were.
    """

    def __init__(self, run: RunDir, config: TrainConfig, frames: int) -> None:
        self.run, self.config, self.frames = run, config, frames
        self._no_renderer = False
        self._gripper = load_gripper(config.gripper)
        self._colour = policy_colours([run.path.name])[run.path.name]  # as evaluate will draw it

    def __enter__(self) -> Self:
        self._hook, threading.excepthook = threading.excepthook, self._thread_failed
        try:
            self._open()
        except OSError as error:
            threading.excepthook = self._hook
            raise self._checkpoint_error(error) from error
        return self

    def _open(self) -> None:
        run, config, frames = self.run, self.config, self.frames
        run.drop_metrics_after(frames)
        if not frames:
            for old in run.tensorboard.glob("events.*"):  # of an attempt that came to no checkpoint
                old.unlink()
        self.writer = SummaryWriter(str(run.tensorboard), purge_step=frames + 1 if frames else None)
        if not frames:
            self.writer.add_text("1_about_this_run", card(run, config))
            self.writer.add_text("2_config", "```\n" + run.config_path.read_text("utf-8") + "```")
            self.writer.add_custom_scalars(layout(algorithm_of(config)))

    def batch(self, number: int, frames: int, groups: dict[str, dict[str, float]], episodes: TensorDictBase) -> None:
        """Logs one batch.

        Args:
          number: of the batch, from 1.
          frames: trained so far.
          groups: scalars by group and name; metrics.csv has a column ``group/name`` for each, TensorBoard its
            :func:`~forcegrasp.train.board.tag`.
          episodes: the batch itself, ``(n, T)``.
        """
        row: dict[str, float] = {"frames": frames}
        for group, scalars in groups.items():
            for name, value in scalars.items():
                column = f"{group}/{name}"
                self.writer.add_scalar(tag(column), value, frames)
                row[column] = value
        self.run.log_metrics(row)
        every = self.config.log
        if every.histograms_every and number % every.histograms_every == 0:
            actions, touching = episodes["action"].clamp(-1, 1), _nonzero(episodes["next", "force"])
            for name, values in (("actions/policy", actions), ("forces/touching_n", touching)):
                # not annotated: its type is guessed from its default, a string
                self.writer.add_histogram(name, values, frames, bins=64)  # pyright: ignore[reportArgumentType]
        if every.figures_every and number % every.figures_every == 0:
            self.traces(episodes[:TRACES], frames)
        self.writer.flush()

    def traces(self, episodes: TensorDictBase, frames: int) -> None:
        """Draws force against goal for a few episodes, as PNG and in TensorBoard."""
        figure = force_traces(episodes.cpu(), f"after {frames:,} frames", self._colour, self._gripper.period_s)
        figure.savefig(self.run.figures / f"traces_{frames:012d}.png", dpi=100)
        self.writer.add_figure("grasps/force_traces", figure, frames)

    def video(self, episode: TensorDictBase, frames: int) -> Path | None:
        """Renders one episode, as GIF and in TensorBoard; says so and goes on where nothing can render."""
        if self._no_renderer:
            return None
        path = self.run.figures / f"grasp_{frames:012d}.gif"
        title = f"after {frames:,} frames"
        try:
            data = grasp_video(
                {title: episode.cpu()}, self.config.sensors, colours={title: self._colour}, gripper=self._gripper
            )
        except NoRendererError as error:
            print(f"forcegrasp: no video: {error}", file=sys.stderr)
            self._no_renderer = True
            return None
        path.write_bytes(data)
        _add_gif(self.writer, "grasps/video", data, frames)
        return path

    def __exit__(self, kind: type | None, error: BaseException | None, _: TracebackType | None) -> None:
        try:
            if error is None:
                self.writer.close()
        except OSError as late:
            raise self._checkpoint_error(late) from late
        finally:
            threading.excepthook = self._hook
        if isinstance(error, OSError):
            raise self._checkpoint_error(error) from error

    def _checkpoint_error(self, error: OSError) -> CheckpointError:
        return CheckpointError(
            f"{self.run.path}: could not write ({error.strerror or error}); free space, then go on with: forcegrasp"
            f" train resume={self.run.path}"
        )

    def _thread_failed(self, facts: threading.ExceptHookArgs) -> None:
        """TensorBoard writes in a thread, and raises here what failed there: no traceback is needed for it."""
        if not isinstance(facts.exc_value, OSError):
            self._hook(facts)


def _nonzero(force: torch.Tensor) -> torch.Tensor:
    touching = force[force != 0]
    return touching if len(touching) else torch.zeros(1)


def _add_gif(writer: SummaryWriter, tag: str, data: bytes, step: int) -> None:
    # SummaryWriter.add_video needs moviepy to encode what is already encoded here.
    # Its messages are made on import.
    from tensorboard.compat.proto.summary_pb2 import Summary  # pyright: ignore[reportAttributeAccessIssue]

    image = Summary.Image(encoded_image_string=data)
    writer._get_file_writer().add_summary(Summary(value=[Summary.Value(tag=tag, image=image)]), step)
