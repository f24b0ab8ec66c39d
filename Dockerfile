FROM python:3.11-slim

# For a CPU build of torch, pass pip's own setting: docker build --build-arg PIP_EXTRA_INDEX_URL=...
ARG PIP_EXTRA_INDEX_URL

RUN useradd --create-home --uid 1000 prefstudy \
    && install --directory --owner=prefstudy /data /var/cache/prefstudy

WORKDIR /opt/prefstudy
COPY . .
RUN pip install --no-cache-dir --constraint constraints.txt --editable .

# Compiled kernels are cached, and the package's own folder can't be written to.
ENV NUMBA_CACHE_DIR=/var/cache/prefstudy \
    PREFSTUDY_DATABASE=sqlite:////data/study.db \
    PYTHONUNBUFFERED=1

USER prefstudy
VOLUME /data
EXPOSE 8000

HEALTHCHECK --interval=30s --timeout=5s --start-period=60s \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]

CMD ["prefstudy", "serve", "--host", "0.0.0.0", "--port", "8000"]
