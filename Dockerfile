# The server in a container: see docs/container.md. The last stage is the one that runs; `development` is for
# .devcontainer. BASE can be any Debian or Ubuntu with Python 3.11 or later.
ARG BASE=debian:stable-slim
ARG NODE=node:22-slim

# Cameras render with libegl1 and libgl1. tini is process 1, because the kernel protects that process from signals of
# its own container: as process 1, a server that hangs took 13 s to stop instead of 5 s, and Docker waits for 10 s.
FROM ${BASE} AS system
RUN apt-get update \
 && apt-get install -y --no-install-recommends libegl1 libgl1 python3 tini \
 && rm -rf /var/lib/apt/lists/*

FROM system AS tools
RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates git iproute2 make python3-pip python3-venv \
 && rm -rf /var/lib/apt/lists/*

# The page of `mjplug view`; the last stage has no Node.js.
FROM ${NODE} AS page
WORKDIR /source/page
COPY page/package.json page/package-lock.json page/.npmrc ./
RUN npm ci --silent
COPY page ./
RUN node build.mjs

# The dependencies are a layer of their own, which is built again when uv.lock changes and not with each change of the
# code. Bytecode is compiled here, because the user below may not write it.
FROM tools AS build
RUN python3 -m venv /uv && /uv/bin/pip install --quiet --no-cache-dir uv
ENV UV_PROJECT_ENVIRONMENT=/opt/mjplug UV_COMPILE_BYTECODE=1 UV_NO_CACHE=1 UV_LINK_MODE=copy UV_PYTHON_DOWNLOADS=never
WORKDIR /source
COPY pyproject.toml uv.lock ./
RUN /uv/bin/uv sync --locked --no-default-groups --extra security --extra view --no-install-project
COPY README.md LICENSE ./
COPY schemas schemas
COPY plugins plugins
COPY mjplug mjplug
COPY --from=page /source/mjplug/view/page mjplug/view/page
RUN /uv/bin/uv sync --locked --no-default-groups --extra security --extra view --no-editable

FROM tools AS development
RUN useradd --create-home --shell /bin/bash developer
USER developer

FROM system
RUN useradd --create-home --uid 1000 mjplug
COPY --from=build /opt/mjplug /opt/mjplug
ENV PATH=/opt/mjplug/bin:$PATH
# Mesa keeps compiled shaders there; /tmp can be written also where the rest is read-only.
ENV XDG_CACHE_HOME=/tmp
# As a number, so that Kubernetes can see that it is not root.
USER 1000
# Configuration files and models are mounted here.
WORKDIR /robot
EXPOSE 7447
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["mjplug", "doctor", "--quick"]
ENTRYPOINT ["tini", "--", "mjplug"]
CMD ["--help"]
