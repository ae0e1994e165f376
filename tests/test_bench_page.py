import bench_page


def test_the_page_says_what_the_bench_shows() -> None:
    assert bench_page.PAGE.read_text() == bench_page.page(), "run python -m tests.bench_page"
