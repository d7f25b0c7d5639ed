"""What other programs on the network may declare on the names of a server: tokens, queryables, subscribers."""

import zenoh
from zenoh.handlers import Callback


def disturbances(session, interfaces, random):
    """Declares what others on the network may declare on the server's names; returns what must be undeclared."""
    declared = []
    for _ in range(random.choice((2, 5, 20))):
        interface, shape = random.choice(interfaces), random.randrange(5)
        chunk = random.choice(("x", "\x1b[31m", "0", "é", "a\nFORGED", "%", "%%", "NN", "MP", "f" * 300))
        if shape == 0:
            depth = random.choice((0, 1, 3, 8, 9, 13, 30))
            key = "/".join(["@ros2_lv", "0", *(random.choice((chunk, "1", "SC", "%")) for _ in range(depth))])
        elif shape == 1:
            key = f"@mjplug/{chunk}/mjplug/{chunk}"
        elif shape == 2:
            kind = {"service": "SC", "subscribed": "MP", "published": "MS"}[interface.kind]
            type_chunk, hash_chunk = interface.ros2_key.split("/")[-2:]
            hash_chunk = random.choice((hash_chunk, "RIHS01_0", chunk))
            name = f"%{interface.key.replace('/', '%')}"
            key = f"@ros2_lv/0/{chunk}/1/2/{kind}/%/%/{chunk}/{name}/{type_chunk}/{hash_chunk}/::,:,:,:,,"
        elif shape == 3:
            handler = random.choice((_ignore, _reply_rubbish))
            declared.append(session.declare_queryable(interface.key, Callback(handler, indirect=False), complete=True))
            continue
        else:
            declared.append(
                session.declare_subscriber(random.choice((interface.ros2_key, "**", interface.key)), _ignore)
            )
            continue
        try:
            declared.append(session.liveliness().declare_token(key))
        except zenoh.ZError:
            continue
    return declared


def _ignore(_):
    pass


def _reply_rubbish(query):
    with query:
        if "*" in str(query.key_expr):
            query.reply_err(b"\xff" * 40)
        else:
            query.reply(str(query.key_expr), b"\xff" * 40)
