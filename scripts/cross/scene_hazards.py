#!/usr/bin/env python3
"""Writes a small library of robots that readers and writers get wrong: names with blanks and letters of other scripts, names
that become the same, a link called world, chains of followers, slides that follow turns, joints without end, meshes in
millimetres and mirrored ones, quarter turns of pitch, one material in two colours, links without mass.

    scripts/cross/scene_hazards.py DIR
"""

import struct
import sys
from pathlib import Path

# A body without symmetry, so that a mirrored one shows: corners and outward triangles of a tetrahedron, millimetres.
CORNERS = [(0, 0, 0), (300, 0, 0), (0, 200, 0), (20, 30, 120)]
TRIANGLES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]

NAMES = """<robot name="odd names">
  <material name="paint"><color rgba="0.8 0.1 0.1 1"/></material>
  <link name="world"><visual><geometry><mesh filename="meshes/body.stl" scale="0.001 0.001 0.001"/></geometry>
    <material name="paint"/></visual></link>
  <link name="lower arm"><visual><origin xyz="0.1 0 0" rpy="0.3 1.5707963267948966 -0.7"/>
    <geometry><mesh filename="meshes/body.stl" scale="-0.001 0.001 0.001"/></geometry>
    <material name="paint"><color rgba="0.1 0.1 0.8 0.5"/></material></visual></link>
  <link name="lower-arm"><visual><geometry><mesh filename="meshes/body.stl" scale="0.001 -0.002 -0.001"/></geometry></visual>
    <visual><origin xyz="0 0 0.4"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>
  <link name="Ünter/arm &amp; &quot;Äste&quot;"><visual><geometry><box size="0.2 0.1 0.1"/></geometry></visual>
    <inertial><origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/><mass value="3"/>
      <inertia ixx="0.02" ixy="0.003" ixz="0" iyy="0.03" iyz="0.001" izz="0.04"/></inertial></link>
  <link name="1::手"><visual><geometry><box size="0.05 0.05 0.2"/></geometry></visual></link>
  <link name="tool0"/>
  <joint name="a 1" type="revolute"><parent link="world"/><child link="lower arm"/>
    <origin xyz="0 0 0.5" rpy="0.4 1.5707963267948966 0.9"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="1.5" effort="1200" velocity="2.5"/><dynamics damping="3" friction="1"/></joint>
  <joint name="a-1" type="revolute"><parent link="lower arm"/><child link="lower-arm"/>
    <origin xyz="0.6 0 0" rpy="-2 -1.5707963267948966 0.2"/><axis xyz="0.6 0 -0.8"/>
    <limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="world" type="continuous"><parent link="lower-arm"/><child link="Ünter/arm &amp; &quot;Äste&quot;"/>
    <origin xyz="0 0.3 0" rpy="1 2 3"/><axis xyz="1 0 0"/></joint>
  <joint name="lower arm" type="prismatic"><parent link="Ünter/arm &amp; &quot;Äste&quot;"/><child link="1::手"/>
    <origin xyz="0.2 0 0"/><axis xyz="0 -1 0"/><limit lower="-0.1" upper="0.4" effort="50" velocity="0.3"/></joint>
  <joint name="end" type="fixed"><parent link="1::手"/><child link="tool0"/><origin rpy="0 -1.5707963267948966 0"/></joint>
</robot>
"""

LED = """<robot name="led">
  <link name="base_link"><visual><geometry><box size="0.3 0.3 0.1"/></geometry></visual></link>
  <link name="b1"><visual><geometry><box size="0.1 0.1 0.6"/></geometry></visual></link>
  <link name="b2"><visual><geometry><box size="0.1 0.1 0.4"/></geometry></visual></link>
  <link name="b3"><visual><geometry><box size="0.1 0.1 0.2"/></geometry></visual></link>
  <link name="b4"><visual><geometry><box size="0.05 0.05 0.2"/></geometry></visual></link>
  <link name="b5"><visual><geometry><box size="0.05 0.02 0.1"/></geometry></visual></link>
  <joint name="j1" type="revolute"><parent link="base_link"/><child link="b1"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>
    <limit lower="-1.2" upper="1.4" effort="100" velocity="2"/></joint>
  <joint name="j2" type="revolute"><parent link="b1"/><child link="b2"/><origin xyz="0 0 0.5" rpy="0 0 1"/><axis xyz="0 1 0"/>
    <limit lower="-4" upper="4" effort="100" velocity="2"/><mimic joint="j1" multiplier="-2" offset="0.1"/></joint>
  <joint name="j3" type="revolute"><parent link="b2"/><child link="b3"/><origin xyz="0 0 0.4"/><axis xyz="1 0 0"/>
    <limit lower="-4" upper="4" effort="100" velocity="2"/><mimic joint="j2" multiplier="0.5" offset="-0.2"/></joint>
  <joint name="j4" type="prismatic"><parent link="b3"/><child link="b4"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" effort="40" velocity="0.2"/></joint>
  <joint name="j5" type="prismatic"><parent link="b4"/><child link="b5"/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="40" velocity="0.2"/><mimic joint="j4" multiplier="1" offset="0.01"/></joint>
</robot>
"""


def stl():
    """Binary STL without normals."""
    bodies = b"".join(struct.pack("<12fH", 0, 0, 0, *(v for corner in t for v in CORNERS[corner]), 0) for t in TRIANGLES)
    return bytes(80) + struct.pack("<I", len(TRIANGLES)) + bodies


def write(folder):
    for name, text in [("odd names 手", NAMES), ("led", LED)]:
        (folder / name / "meshes").mkdir(parents=True, exist_ok=True)
        (folder / name / "robot.urdf").write_text(text, encoding="utf-8")
        (folder / name / "meshes/body.stl").write_bytes(stl())


if __name__ == "__main__":
    write(Path(sys.argv[1]))
