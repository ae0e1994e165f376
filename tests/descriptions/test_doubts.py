from tests.descriptions.doubts import main

LINK = """<robot name="{name}"><link name="root"/><link name="rod"><inertial><mass value="{mass}"/><inertia ixx="0.01"
ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link><joint name="j" type="continuous"><parent link="root"/>
<child link="rod"/>{inside}</joint></robot>"""


def test_the_table_has_a_row_a_robot_with_what_is_doubted(tmp_path, capsys):
    for name, mass, inside in (
        ("light", 1, '<dynamics damping="0.1"/>'),
        ("heavy", 2400, ""),
        ("none", 1, "<parent/>"),
    ):
        folder = tmp_path / name / "urdf"
        folder.mkdir(parents=True)
        text = LINK.format(name=name, mass=mass, inside=inside)
        (folder / f"{name}.urdf").write_text(text if name != "none" else "<robot name='n'/>")
        (folder / f"{name}_too.urdf").write_text(text)  # the same robot once more
    assert main([str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "3 robots, 2 of them doubted or refused."
    heavy, light, none = lines[4:]
    assert light == "| light.urdf | 1 | 1 | damping | - |"
    assert heavy.startswith('| heavy.urdf | 1 | 2.4e+03 | - | link "rod": 2400 kg with the inertia of ')
    assert none == "| none.urdf | - | - | - | refused: no <link>, expected at least one |"
