import threading

from catenary.sensing.mailbox import Kind, Mailbox


def test_samples_are_taken_in_the_order_in_which_they_came():
    mailbox = Mailbox()
    mailbox.put(1.0, [1, 2, 3], Kind.SPECIFIC_FORCE)
    mailbox.put(0.5, [4, 5, 6], Kind.ANGULAR_RATE)
    assert len(mailbox) == 2
    assert mailbox.take() == (1.0, (1.0, 2.0, 3.0), Kind.SPECIFIC_FORCE)
    assert mailbox.take() == (0.5, (4.0, 5.0, 6.0), Kind.ANGULAR_RATE)
    assert mailbox.take() is None


def test_a_full_mailbox_drops_the_oldest_and_counts_them():
    mailbox = Mailbox(3)
    for k in range(5):
        mailbox.put(k, [0.0, 0.0, 0.0], Kind.FREE_FALL)
    assert mailbox.dropped == 2
    assert mailbox.take().stamp == 2.0


def test_what_a_thread_puts_another_takes_without_loss():
    mailbox, taken = Mailbox(100_000), []

    def write():
        for k in range(20_000):
            mailbox.put(k, [k, k, k], Kind.SPECIFIC_FORCE)

    writer = threading.Thread(target=write)
    writer.start()
    while writer.is_alive() or len(mailbox):
        sample = mailbox.take()
        if sample is not None:
            taken.append(sample.stamp)
    writer.join()
    assert taken == list(range(20_000))
