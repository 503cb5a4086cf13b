"""The same tracks as every program would write them, after the public documentation of their formats."""

from __future__ import annotations

import numpy as np

SIZE = (1280.0, 720.0)
FPS = 120.0
NAMES = ("LM1", "LM2", "LM3", "LM4")
FIRST = 30
"""First frame: exports count their time from the video's start."""


def pixels(frames: int = 7) -> np.ndarray:
    """Smooth tracks ``(frames, 4, 2)`` with two decimals."""
    k = np.arange(frames)[:, None]
    i = np.arange(len(NAMES))[None]
    u = 600.0 + 37.25 * i + 1.5 * k + 0.25 * k * i
    v = 300.0 - 21.5 * i + 0.75 * k
    return np.round(np.stack([u, v], axis=-1), 2)


def clicks(p: np.ndarray) -> str:
    rows = ["frame,landmark_id,u_px,v_px"]
    rows += [f"{FIRST + k},{n},{u:.2f},{v:.2f}" for k, row in enumerate(p) for n, (u, v) in zip(NAMES, row)]
    return "\n".join(rows) + "\n"


def weighted_clicks(p: np.ndarray) -> str:
    rows = ["frame,landmark_id,u_px,v_px,weight"]
    rows += [f"{FIRST + k},{n},{u:.2f},{v:.2f},0.5" for k, row in enumerate(p) for n, (u, v) in zip(NAMES, row)]
    return "\n".join(rows) + "\n"


def kva(p: np.ndarray, ticks: int = 512, first: int = 1024) -> str:
    """Kinovea 0.9 and later: absolute time stamps, name as attribute, millimetric user coordinates elsewhere."""
    tracks = []
    for j, name in enumerate(NAMES):
        stamps = [first + (FIRST + k) * ticks for k in range(len(p))]
        points = "\n".join(
            f'        <TrackPoint UserX="1,5" UserXInvariant="1.5" UserY="2,5" UserYInvariant="2.5" '
            f'UserTime="0:00:00:25">{u};{v};{t}</TrackPoint>'
            for (u, v), t in zip(p[:, j], stamps)
        )
        tracks.append(
            f'    <Track id="5b0e" name="{name}">\n      <TimePosition>{stamps[0]}</TimePosition>\n'
            f'      <Mode>Complete</Mode>\n      <TrackPointList Count="{len(p)}" UserUnitLength="cm">\n{points}\n'
            f'      </TrackPointList>\n      <MainLabel Text="{name}"><SpacePosition>1;1</SpacePosition>'
            f"</MainLabel>\n    </Track>"
        )
    return (
        '\ufeff<?xml version="1.0" encoding="utf-8"?>\n<KinoveaVideoAnalysis>\n  <FormatVersion>2.0</FormatVersion>\n'
        "  <Producer>Kinovea.0.9.5</Producer>\n  <OriginalFilename>play.mp4</OriginalFilename>\n"
        f"  <ImageSize>{SIZE[0]:.0f};{SIZE[1]:.0f}</ImageSize>\n"
        f"  <AverageTimeStampsPerFrame>{ticks}</AverageTimeStampsPerFrame>\n"
        f"  <FirstTimeStamp>{first}</FirstTimeStamp>\n  <SelectionStart>{first}</SelectionStart>\n"
        "  <Tracks>\n" + "\n".join(tracks) + "\n  </Tracks>\n</KinoveaVideoAnalysis>\n"
    )


def kva_08(p: np.ndarray, ticks: int = 512) -> str:
    """Kinovea 0.8 (format 1.5): time stamps from the track's own start, another spelling, whole pixels."""
    tracks = []
    for j, name in enumerate(NAMES):
        points = "".join(
            f'<TrackPosition UserX="1,00" UserTime="0">{u:.0f};{v:.0f};{k * ticks}</TrackPosition>'
            for k, (u, v) in enumerate(p[:, j])
        )
        tracks.append(
            f"<Track>\n<TimePosition>{FIRST * ticks}</TimePosition><Mode>0</Mode>"
            f'<TrackPositionList Count="{len(p)}" UserUnitLength="px">{points}</TrackPositionList>\n'
            f"<Label><Text>{name}</Text></Label></Track>"
        )
    return (
        '<?xml version="1.0"?>\n<KinoveaVideoAnalysis><FormatVersion>1.5</FormatVersion><Producer>Kinovea.0.8.15'
        f"</Producer><ImageSize>{SIZE[0]:.0f};{SIZE[1]:.0f}</ImageSize>\n"
        f"<AverageTimeStampsPerFrame>{ticks}</AverageTimeStampsPerFrame><FirstTimeStamp>0</FirstTimeStamp>"
        f"<Tracks>{''.join(tracks)}</Tracks></KinoveaVideoAnalysis>\n"
    )


def _user(p: np.ndarray) -> np.ndarray:
    """User coordinates: pixels from the image's centre, y up."""
    return np.stack([p[..., 0] - 0.5 * SIZE[0], 0.5 * SIZE[1] - p[..., 1]], axis=-1)


def _local(value: float, comma: bool) -> str:
    return f"{value:.2f}".replace(".", ",") if comma else f"{value:.2f}"


def kinovea_txt(p: np.ndarray, comma: bool = False) -> str:
    rows = ["#Kinovea Trajectory data export", "#T X Y"]
    for j, name in enumerate(NAMES):
        rows += ["", f"# {name}"]
        for k, (x, y) in enumerate(_user(p)[:, j]):
            rows.append(f"{(FIRST + k) / FPS:.3f} {_local(x, comma)} {_local(y, comma)} ")
    return "\n".join(rows) + "\n"


def kinovea_csv(p: np.ndarray, comma: bool = False, unit: str = "s", time: str = "Time") -> str:
    factor = {"s": 1.0, "ms": 1e3, "us": 1e6, "frame": FPS}[unit]
    mark = ";" if comma else ","
    quoted = [f'"{time}"', *(f'"{name} {axis}"' for name in NAMES for axis in "XY")]
    rows = [mark.join(quoted)]
    for k, row in enumerate(_user(p)):
        stamp = f"{(FIRST + k) / FPS * factor:.3f}"
        cells = [stamp.replace(".", ",") if comma else stamp]
        cells += [_local(c, comma) for point in row for c in point]
        rows.append(mark.join(f'"{cell}"' if comma else cell for cell in cells))
    return "\n".join(rows) + "\n"


def kinovea_xml(p: np.ndarray, unit: str = "px") -> str:
    def cell(kind: str, text: str) -> str:
        return f'        <Cell ss:StyleID="data"><Data ss:Type="{kind}">{text}</Data></Cell>\n'

    def row(*cells: str) -> str:
        return "      <Row>\n" + "".join(cells) + "      </Row>\n"

    body = row(cell("String", ""))
    for j, name in enumerate(NAMES):
        body += row(cell("String", "Track"))
        body += row(cell("String", "Label :"), cell("String", name))
        body += row(cell("String", f"Coords (x,y:{unit}; t:time)"))
        body += row(cell("String", "x"), cell("String", "y"), cell("String", "t"))
        for k, (x, y) in enumerate(_user(p)[:, j]):
            stamp = f"{(FIRST + k) / FPS:.3f}"
            body += row(cell("Number", f"{x:.2f}"), cell("Number", f"{y:.2f}"), cell("String", stamp))
        body += row(cell("String", ""))
    return (
        '<?xml version="1.0" encoding="utf-8"?><?mso-application progid="Excel.Sheet"?>\n'
        '<Workbook xmlns="urn:schemas-microsoft-com:office:spreadsheet" '
        'xmlns:ss="urn:schemas-microsoft-com:office:spreadsheet">\n  <Worksheet ss:Name="play">\n    <Table>\n'
        f"{body}    </Table>\n  </Worksheet>\n</Workbook>\n"
    )


def deeplabcut(p: np.ndarray, individuals: tuple[str, ...] = ()) -> str:
    who = individuals or ("",)
    heads = {"scorer": [], "individuals": [], "bodyparts": [], "coords": []}
    for person in who:
        for name in NAMES:
            for coord in ("x", "y", "likelihood"):
                for key, value in zip(heads, ("DLC_resnet50", person, name, coord)):
                    heads[key].append(value)
    if not individuals:
        del heads["individuals"]
    rows = [",".join([key, *values]) for key, values in heads.items()]
    for k, row in enumerate(p):
        cells = [f"{u:.2f},{v:.2f},{0.9 if k else 0.99}" for u, v in row]
        rows.append(",".join([str(FIRST + k), *cells * len(who)]))
    return "\n".join(rows) + "\n"


def sleap(p: np.ndarray, tracks: tuple[str, ...] = ("",)) -> str:
    rows = ["track,frame_idx,instance.score," + ",".join(f"{n}.x,{n}.y,{n}.score" for n in NAMES)]
    for track in tracks:
        for k, row in enumerate(p):
            rows.append(f"{track},{FIRST + k},0.93," + ",".join(f"{u:.2f},{v:.2f},0.8" for u, v in row))
    return "\n".join(rows) + "\n"


FORMATS = {
    "clicks": clicks,
    "weighted clicks": weighted_clicks,
    "kva": kva,
    "kva 0.8": kva_08,
    "kinovea_xml": kinovea_xml,
    "kinovea_txt": kinovea_txt,
    "kinovea_txt, comma": lambda p: kinovea_txt(p, comma=True),
    "kinovea_csv": kinovea_csv,
    "kinovea_csv, comma": lambda p: kinovea_csv(p, comma=True),
    "kinovea_csv, ms": lambda p: kinovea_csv(p, unit="ms"),
    "kinovea_csv, us": lambda p: kinovea_csv(p, unit="us"),
    "kinovea_csv, frames": lambda p: kinovea_csv(p, unit="frame"),
    "deeplabcut": deeplabcut,
    "sleap": sleap,
}
