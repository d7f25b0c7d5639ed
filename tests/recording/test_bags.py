"""Bags that were killed, damaged, cut and filtered, and disks that are full."""

import errno
import json
import os
import shutil

import pytest
from cli.tour import typed
from recording.readers import by_mcap, by_rosbags, metadata_of

from mjplug.bag import mcap_writer
from mjplug.bag.definitions import text_of_class
from mjplug.bag.errors import BagError
from mjplug.bag.reader import Bag
from mjplug.bag.repair import check, recover
from mjplug.bag.topics import BagTopic
from mjplug.bag.writer import BagWriter, Limits, Record
from mjplug.contracts.transport import DEFAULT, LATCHED
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.std_msgs import String, UInt64

TOLD = BagTopic("/told", String.TYPE, text_of_class(String), type_hash(String), DEFAULT)
STATIC = BagTopic("/static", UInt64.TYPE, text_of_class(UInt64), type_hash(UInt64), LATCHED)


def told(number, seconds):
    return Record("/told", round(seconds * 1e9), 7, number + 1, String(data=f"{number} " * 200).to_cdr(), b"g" * 16)


def new_bag(folder, **options):
    bag = BagWriter(folder, **options)
    bag.add_topic(TOLD)
    bag.add_topic(STATIC)
    bag.describe({"clock": "sim", "epoch": "/mjplug 3"})
    return bag


def written(folder, count=1000, **options):
    """A finished bag with a latched message and `count` messages, 10 ms apart."""
    bag = new_bag(folder, **options)
    bag.write(Record("/static", 0, 7, 1, UInt64(data=5).to_cdr()))
    for number in range(count):
        bag.write(told(number, 0.01 * number))
    bag.finish({"lost": '{"/told": 2}'})
    return folder


def payloads(folder):
    return [read.data for read in by_rosbags(folder)]


def test_a_killed_bag_is_recovered_to_the_last_message_that_was_flushed(tmp_path):
    bag = new_bag(tmp_path / "bag", limits=Limits(bytes=200_000), compression="none")
    for number in range(1500):
        bag.write(told(number, 0.01 * number))
    bag.flush()
    # These wait in memory.
    for number in range(1500, 1505):
        bag.write(told(number, 0.01 * number))
    shutil.copytree(tmp_path / "bag", tmp_path / "killed")
    opened = Bag(tmp_path / "killed")
    assert opened.open
    assert len(opened.files) >= 4
    problems = list(check(opened))
    assert "was not completed" in problems[0]
    assert any("messages can be read" in problem for problem in problems)
    result = recover(opened, tmp_path / "recovered")
    assert result.messages == 1500
    assert payloads(tmp_path / "recovered") == [told(number, 0).data for number in range(1500)]
    assert list(check(Bag(tmp_path / "recovered"))) == []
    assert metadata_of(tmp_path / "recovered" / "recovered_0.mcap")["epoch"] == "/mjplug 3"
    # Without metadata.yaml too.
    (tmp_path / "killed" / "metadata.yaml").unlink()
    assert recover(Bag(tmp_path / "killed"), tmp_path / "again").messages == 1500


def test_a_file_that_was_cut_anywhere_is_recovered_up_to_the_cut(tmp_path):
    written(tmp_path / "bag", 600, compression="none")
    raw = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    whole = [told(number, 0).data for number in range(600)]
    counts = []
    for number, size in enumerate(range(len(raw) - 1, 100, -len(raw) // 23)):
        cut = tmp_path / f"cut{number}.mcap"
        cut.write_bytes(raw[:size])
        assert list(check(Bag(cut))) != []
        try:
            result = recover(Bag(cut), tmp_path / f"recovered{number}")
        except BagError:
            counts.append(0)
            continue
        counts.append(result.messages)
        read = payloads(tmp_path / f"recovered{number}")
        assert [data for data in read if len(data) > 20] == whole[: result.messages - 1]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == 601


def test_changed_bytes_are_noticed_and_what_is_before_them_is_recovered(tmp_path):
    written(tmp_path / "bag", 3000, compression="none")
    path = tmp_path / "bag" / "bag_0.mcap"
    raw = bytearray(path.read_bytes())
    raw[len(raw) * 3 // 4] ^= 0xFF
    path.write_bytes(raw)
    (problem,) = check(Bag(tmp_path / "bag"))
    assert "crc" in problem
    result = recover(Bag(tmp_path / "bag"), tmp_path / "recovered")
    assert 500 < result.messages < 3001
    assert "crc" in result.damage["bag_0.mcap"]
    assert list(check(Bag(tmp_path / "recovered"))) == []


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"not a bag", bytes(1000)])
def test_a_file_that_is_no_bag_is_refused_in_one_sentence(tmp_path, content):
    (tmp_path / "x.mcap").write_bytes(content)
    assert list(check(Bag(tmp_path / "x.mcap"))) != []
    with pytest.raises(BagError, match="no message"):
        recover(Bag(tmp_path / "x.mcap"), tmp_path / "recovered")
    with pytest.raises(BagError, match="there is no bag"):
        Bag(tmp_path / "missing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match="contains no MCAP file"):
        Bag(tmp_path / "empty")


def test_a_chunk_that_claims_to_be_huge_is_not_unpacked(tmp_path):
    written(tmp_path / "bag", 10)
    path = tmp_path / "bag" / "bag_0.mcap"
    raw = bytearray(path.read_bytes())
    at = raw.index(b"zstd") - 4 - 4 - 8
    raw[at : at + 8] = (1 << 40).to_bytes(8, "little")
    path.write_bytes(raw)
    (problem,) = check(Bag(tmp_path / "bag"))
    assert "claims to contain 1099511627776" in problem


class Disk:
    """Lets the files of a folder take a number of bytes, and no more."""

    def __init__(self, size):
        self.left = size
        self._write, self._truncate = os.write, os.ftruncate

    def write(self, file, data):
        if self.left == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        done = self._write(file, data[: self.left])
        self.left -= done
        return done

    def ftruncate(self, file, size):
        self.left += os.fstat(file).st_size - size
        self._truncate(file, size)


@pytest.mark.parametrize("size", [1_000, 40_000, 400_000, 400_123, 555_555])
@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_a_full_disk_leaves_a_whole_bag_with_what_fits(tmp_path, monkeypatch, size, compression):
    disk = Disk(size)
    bag = new_bag(tmp_path / "bag", compression=compression)
    monkeypatch.setattr(mcap_writer.os, "write", disk.write)
    monkeypatch.setattr(mcap_writer.os, "ftruncate", disk.ftruncate)
    accepted = []

    def fill():
        for number in range(100_000):
            data = os.urandom(1000) if compression == "zstd" else bytes(1000)
            bag.write(Record("/told", number, 7, number, String(data=data.hex()).to_cdr()))
            accepted.append(number)
            if number % 50 == 49:
                bag.flush()

    with pytest.raises(BagError, match=r"the disk of .*bag is full"):
        fill()
    try:
        bag.finish()
    except BagError:
        # Not even the index of an empty file fits.
        assert size == 1_000
        return
    monkeypatch.undo()
    assert list(check(Bag(tmp_path / "bag"))) == []
    times = [read.log_time for read in by_rosbags(tmp_path / "bag")]
    assert times == list(range(len(times)))
    # What does not fit is at most what one chunk contains and the index needs.
    assert len(times) * 2000 > size - 250_000
    assert len(times) <= len(accepted)


def test_a_part_of_the_time_is_cut_with_the_latched_messages_from_before(tmp_path):
    written(tmp_path / "bag")
    done = typed("bag", "cut", str(tmp_path / "bag"), "--start", "2", "--end", "2.5", "-o", str(tmp_path / "part"))
    assert (done.code, done.out) == (0, f"wrote {tmp_path / 'part'} with 52 messages\n")
    read = by_rosbags(tmp_path / "part")
    assert [r.log_time for r in read if r.topic == "/told"] == [n * 10_000_000 for n in range(200, 251)]
    assert [(r.topic, r.log_time, r.data) for r in read if r.topic == "/static"] == [
        ("/static", 2 * 10**9, UInt64(data=5).to_cdr())
    ]
    assert [r.data for r in read if r.topic == "/told"] == [told(n, 0).data for n in range(200, 251)]
    assert metadata_of(tmp_path / "part" / "part_0.mcap")["clock"] == "sim"
    done = typed("bag", "cut", str(tmp_path / "bag"), "--start", "2", "--end", "1")
    assert (done.code, "is before --start 2" in done.err) == (2, True)


def test_topics_are_filtered(tmp_path):
    written(tmp_path / "bag", 20)
    bag = str(tmp_path / "bag")
    for number, (words, left) in enumerate(
        ((("told",), {"/told"}), (("-x", "told"), {"/static"}), (("-e", "t.l|st"), {"/told", "/static"}))
    ):
        done = typed("bag", "filter", bag, *words, "-o", str(tmp_path / f"f{number}"))
        assert done.code == 0, done
        assert {read.topic for read in by_mcap(tmp_path / f"f{number}" / f"f{number}_0.mcap")} == left
    done = typed("bag", "filter", bag, "/tolt", "-o", str(tmp_path / "none"))
    assert (done.code, "did you mean '/told'" in done.err) == (1, True)
    assert not (tmp_path / "none").exists()
    assert typed("bag", "filter", bag).code == 2


def test_a_bag_is_described_and_checked(tmp_path):
    written(tmp_path / "bag", limits=Limits(duration_ns=4 * 10**9))
    done = typed("bag", "info", str(tmp_path / "bag"), "--json")
    about = json.loads(done.out)
    assert (about["messages"], about["duration"], about["clock"], about["unfinished"]) == (1003, 9.99, "sim", False)
    topics = {topic["name"]: topic for topic in about["topics"]}
    assert (topics["/told"]["messages"], topics["/told"]["lost"], topics["/told"]["type"]) == (1000, 2, String.TYPE)
    assert [file["messages"] for file in about["files"]] == [401, 401, 201]
    text = typed("bag", "info", str(tmp_path / "bag")).out
    assert "duration:  9.990 s" in text
    assert "/told    std_msgs/msg/String  1000" in text
    done = typed("bag", "check", str(tmp_path / "bag"))
    assert (done.code, done.out) == (0, "ok · 3 files, 1003 messages\n")
    path = tmp_path / "bag" / "bag_1.mcap"
    path.write_bytes(path.read_bytes()[:-30])
    done = typed("bag", "check", str(tmp_path / "bag"))
    assert done.code == 1
    assert "bag_1.mcap" in done.err
    done = typed("bag", "cut", str(tmp_path / "bag"), "-o", str(tmp_path / "cut"))
    assert (done.code, "mjplug bag recover" in done.err) == (1, True)
    done = typed("bag", "recover", str(tmp_path / "bag"))
    assert done.code == 0
    assert done.out == f"wrote {tmp_path / 'bag_recovered'} with 1003 messages\n"
    assert len(by_rosbags(tmp_path / "bag_recovered")) == 1003
    assert typed("bag", "check", str(tmp_path / "no_bag")).err == f"error: there is no bag {tmp_path / 'no_bag'}\n"


def test_bags_of_rosbags_are_read(tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / "theirs", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/told", String.TYPE, typestore=store)
        for number in range(10):
            writer.write(connection, 1000 + number, String(data=str(number)).to_cdr())
    bag = Bag(tmp_path / "theirs")
    assert list(check(bag)) == []
    assert [(m.topic.name, m.log_time, m.data) for m in bag.messages()] == [
        ("/told", 1000 + number, String(data=str(number)).to_cdr()) for number in range(10)
    ]
