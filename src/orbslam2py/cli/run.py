# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run``: the system over a recorded sequence, a video or a camera."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console

from orbslam2py.cli.imu_arguments import check_units, imu_settings_given, read_tables
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.publishing import (
    MCAP,
    BaseFrameOption,
    BaseTransformOption,
    FoxgloveFlag,
    FoxgloveHost,
    FoxglovePort,
    PublishOption,
    PublishOptions,
    network_of,
)
from orbslam2py.cli.run_and_show import run_and_show
from orbslam2py.cli.run_arguments import read_initial_pose
from orbslam2py.cli.run_options import (
    AccelUnitOption,
    AllowOtherSetupFlag,
    AutosaveOption,
    DeterministicFlag,
    EffortOption,
    FinalAdjustmentFlag,
    ForceFlag,
    FpsOption,
    FullAdjustmentFlag,
    FullAdjustmentTimeLimitOption,
    GyroUnitOption,
    ImuFlag,
    ImuNoiseOption,
    ImuSamplesOption,
    ImuSettingsOption,
    InitialPoseOption,
    LoadOption,
    LocalizeOption,
    LoopClosingFlag,
    MaskOption,
    MaxFramesOption,
    NewMapAfterOption,
    NoReportFlag,
    OutputOption,
    QuietFlag,
    RealtimeFlag,
    RecordInputOption,
    SaveImagesFlag,
    SaveOption,
    SavePatchesFlag,
    SeedOption,
    SensorOption,
    SequenceArgument,
    SetOption,
    SettingsOption,
    SeveralMapsFlag,
    SplitFlag,
    StartOption,
    StrideOption,
    TimesOption,
    TopicsOption,
    VocabularyOption,
)
from orbslam2py.cli.targets import check_apart, check_kept
from orbslam2py.cli.viewing import ViewerExit, ViewerFlag, ViewerHost, ViewerOptions, ViewerPort
from orbslam2py.cli.watching import RecordOption, VideoOption
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.live import open_source
from orbslam2py.maps import MapFile
from orbslam2py.maps.setup_check import check_sensor
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.runs.input_folders import check_not_among_images
from orbslam2py.runs.options import RunOptions
from orbslam2py.settings import Settings
from orbslam2py.slam.config import read_change
from orbslam2py.slam.effort import Effort
from orbslam2py.slam.options import SystemOptions

EXAMPLE = """
**Example**

    orbslam2py run rgbd_dataset_freiburg1_desk --sensor rgbd

    orbslam2py run dataset/sequences/06 --sensor stereo --output runs/06

    orbslam2py run video.mp4 --sensor mono --settings my.yaml

    orbslam2py run phone --sensor rgbd --settings camera.yaml

    orbslam2py run drive.mcap --sensor stereo

    orbslam2py run 0 --sensor mono --settings my.yaml

    orbslam2py run realsense: --sensor stereo --imu --record-input drive.mcap

    orbslam2py run ros2: --sensor stereo

    orbslam2py run video.mp4 --sensor mono --settings my.yaml --save office.orbmap

    orbslam2py run video.mp4 --load office.orbmap --localize
"""


def run(
    sequence: SequenceArgument,
    sensor: SensorOption = None,
    settings: SettingsOption = None,
    vocabulary: VocabularyOption = None,
    output: OutputOption = None,
    deterministic: DeterministicFlag = False,
    realtime: RealtimeFlag = False,
    start: StartOption = 0,
    stride: StrideOption = 1,
    max_frames: MaxFramesOption = None,
    fps: FpsOption = None,
    times: TimesOption = None,
    mask: MaskOption = None,
    topics: TopicsOption = None,
    split: SplitFlag = False,
    imu: ImuFlag = None,
    imu_settings: ImuSettingsOption = None,
    imu_noise: ImuNoiseOption = None,
    imu_samples: ImuSamplesOption = None,
    gyro_unit: GyroUnitOption = None,
    accel_unit: AccelUnitOption = None,
    load: LoadOption = None,
    initial_pose: InitialPoseOption = None,
    allow_other_setup: AllowOtherSetupFlag = False,
    localize: LocalizeOption = None,
    save: SaveOption = None,
    autosave: AutosaveOption = None,
    save_images: SaveImagesFlag = False,
    save_patches: SavePatchesFlag = True,
    loop_closing: LoopClosingFlag = True,
    full_adjustment: FullAdjustmentFlag = True,
    full_adjustment_time_limit: FullAdjustmentTimeLimitOption = None,
    final_adjustment: FinalAdjustmentFlag = False,
    several_maps: SeveralMapsFlag = True,
    new_map_after: NewMapAfterOption = None,
    effort: EffortOption = Effort.NORMAL,
    set_: SetOption = None,
    seed: SeedOption = 0,
    video: VideoOption = None,
    record: RecordOption = None,
    publish: PublishOption = None,
    base_frame: BaseFrameOption = None,
    base_transform: BaseTransformOption = None,
    foxglove: FoxgloveFlag = False,
    foxglove_port: FoxglovePort = None,
    foxglove_host: FoxgloveHost = None,
    record_input: RecordInputOption = None,
    force: ForceFlag = False,
    no_report: NoReportFlag = False,
    viewer: ViewerFlag = False,
    viewer_port: ViewerPort = None,
    viewer_host: ViewerHost = None,
    viewer_exit: ViewerExit = False,
    quiet: QuietFlag = False,
) -> None:
    """Track a recorded sequence, a video or a live source; write trajectory, map and report."""
    check_kept(video, record, record_input, force=force)
    if save_images and save is None:
        raise DatasetError("--save-images keeps images in the map that is saved: --save FILE")
    if not save_patches and save is None:
        raise DatasetError(
            "--no-save-patches leaves patches out of the map that is saved: --save FILE"
        )
    if new_map_after is not None and not several_maps:
        raise SettingsError(
            "--new-map-after says when another map begins, and with --one-map none does; leave out "
            "one of them"
        )
    adjusts = final_adjustment or (loop_closing and full_adjustment)
    if full_adjustment_time_limit is not None and not adjusts:
        raise SettingsError(
            "--full-adjustment-time-limit limits full adjustments, and this run makes none; leave "
            "it out, or take --final-adjustment"
        )
    check_units(imu_samples, gyro_unit, accel_unit)
    look = ViewerOptions(viewer, viewer_port, viewer_host, viewer_exit)
    log_to(Console(stderr=True), quiet=quiet)  # opening warns already
    for_foxglove = record is not None and record.suffix.lower() == MCAP
    publishing = PublishOptions(
        network_of(sequence, publish),
        base_frame,
        base_transform,
        foxglove,
        foxglove_port,
        foxglove_host,
        record if for_foxglove else None,
    )
    loaded = None if load is None else MapFile(load)
    chosen: Settings | str | None = settings
    if loaded is not None and settings is None:
        if sensor is not None:
            check_sensor(loaded, sensor)
        sensor, chosen = loaded.sensor, loaded.settings
    images = open_source(
        sequence,
        sensor,
        settings=chosen,
        fps=fps,
        times=times,
        mask=mask,
        topics=topics,
        split=split,
        imu=imu is True,
    )
    if record_input is not None and is_sequence(images):
        raise DatasetError(
            f"--record-input records a live source, and {sequence} is recorded already; leave it "
            "out"
        )
    if output is not None:
        check_apart({"--output": output}, [] if mask is None else [mask])
        check_not_among_images(output, images, Path(sequence))
    options = RunOptions(
        images.sensor,
        SystemOptions(
            deterministic=deterministic,
            loop_closing=loop_closing,
            full_adjustment=full_adjustment,
            full_adjustment_time_limit=full_adjustment_time_limit,
            several_maps=several_maps,
            new_map_after=SystemOptions.new_map_after if new_map_after is None else new_map_after,
            effort=effort,
            config=dict(map(read_change, set_ or ())),
            keyframe_images=save_images,
            point_patches=save_patches,
            seed=seed,
        ),
        realtime=realtime,
        start=start,
        stride=stride,
        max_frames=max_frames,
        localize_after=localize,
        final_adjustment=final_adjustment,
        load_map=loaded,
        initial_pose=None if initial_pose is None else read_initial_pose(initial_pose),
        allow_other_setup=allow_other_setup,
        save_map=save,
        autosave=autosave,
        imu=imu,
        imu_settings=(
            None if imu is False else imu_settings_given(settings, imu_settings, imu_noise)
        ),
        imu_samples=read_tables(imu_samples, gyro_unit, accel_unit),
    )
    code = run_and_show(
        images,
        options,
        vocabulary=vocabulary,
        output=output,
        force=force,
        report_page=not no_report,
        viewer=look,
        video=video,
        record=record,
        publish=publishing,
        record_input=record_input,
        inputs=[
            Path(given)
            for given in (
                *(sequence, settings, times, mask, vocabulary),
                *(imu_samples or ()),
                *(imu_settings or ()),
            )
            if given
        ],
        quiet=quiet,
    )
    raise typer.Exit(code)


run.__doc__ = f"{run.__doc__}\n{EXAMPLE}"
