from command_line import catenary


def test_regressor_prints_what_is_identifiable() -> None:
    text = catenary("regressor", "raven2").out
    assert "m(insertion)   by itself       by itself            0.231    kg" in text
    assert "b1  mx(shoulder)" in text
    assert "without effect on any torque: m(shoulder), mz(shoulder), m(elbow)" in text


def test_compact_form_of_the_planar_arm_is_the_papers() -> None:
    text = catenary("regressor", "planar_3r", "--compact").out
    assert (
        "\ng = g_c [[c1 c12 c123],[0 c12 c123],[0 0 c123]] [s1 s2 s3]^T\n"
        "s1 = l1 (m2+m3) + lg1 m1\ns2 = l2 m3 + lg2 m2\ns3 = lg3 m3\n"
    ) in text
    assert "lg3  centre of mass of link3, along x [m]         0.1" in text
