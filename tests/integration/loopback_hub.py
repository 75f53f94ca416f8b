"""A Hugging Face Hub on this machine, as much of it as uploading and loading a dataset or an environment needs.

Every file is a regular git blob, sent inside the commit: there is neither LFS nor Xet. Branches and tags name
commits, and a commit maps paths to contents.
"""

import base64
import hashlib
import json
import os
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import unquote, urlsplit

USER = "someone"
TOKEN = "hf_loopback"


class Repository:
    """A repository of one kind, `datasets` or `models`: commits, and the branches and tags that name them."""

    def __init__(self, kind: str = "datasets"):
        self.kind = kind
        self.commits: dict[str, dict[str, bytes]] = {}
        self.branches: dict[str, str] = {}
        self.tags: dict[str, str] = {}
        self.commit("main", {".gitattributes": b"* -text\n"})

    def commit(self, branch: str, files: dict[str, bytes]) -> str:
        """Add a commit to a branch; its name."""
        text = repr((len(self.commits), sorted(files.items())))
        name = hashlib.sha1(text.encode()).hexdigest()
        self.commits[name] = files
        self.branches[branch] = name
        return name

    def resolve(self, revision: str) -> str | None:
        """Name of the commit that a branch, a tag or a commit's name means."""
        if revision in self.commits:
            return revision
        return self.branches.get(revision) or self.tags.get(revision)

    def files(self, revision: str) -> dict[str, bytes]:
        """Paths and contents of a revision."""
        name = self.resolve(revision)
        assert name is not None, f"no revision {revision}"
        return self.commits[name]


class LoopbackHub(ThreadingHTTPServer):
    """Serves while its `with` block runs."""

    daemon_threads = True

    def __init__(self):
        super().__init__(("127.0.0.1", 0), _Handler)
        self.repositories: dict[str, Repository] = {}
        self.address = f"http://127.0.0.1:{self.server_port}"

    def __enter__(self) -> Self:
        """Start serving."""
        threading.Thread(target=self.serve_forever, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Stop serving."""
        self.shutdown()
        self.server_close()


class Desk:
    """Somebody's machine: a home without any cache, and the loopback Hub as the only one."""

    def __init__(self, folder: Path, address: str, token: str | None):
        self.folder = folder
        self.environment = {name: value for name, value in os.environ.items() if not name.startswith("HF_")}
        self.environment |= {
            "HF_ENDPOINT": address,
            "HF_HOME": str(folder / "hf_home"),
            "HF_HUB_DISABLE_XET": "1",
            "OMP_NUM_THREADS": "1",
        }
        if token is not None:
            self.environment["HF_TOKEN"] = token
        folder.mkdir()

    def run(self, *words: str, **changes: str) -> subprocess.CompletedProcess[str]:
        """A command of this environment in the folder."""
        program = str(Path(sys.executable).with_name(words[0]))
        return subprocess.run(
            [program, *words[1:]],
            cwd=self.folder,
            env=self.environment | changes,
            capture_output=True,
            text=True,
            check=False,
        )


class _Handler(BaseHTTPRequestHandler):
    server: LoopbackHub
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        match self._path():
            case ["api", ("datasets" | "models") as kind, user, name, *rest]:
                self._describe(kind, f"{user}/{name}", rest)
            case ["datasets", user, name, "resolve", revision, *path]:
                self._file("datasets", f"{user}/{name}", revision, "/".join(path))
            case [user, name, "resolve", revision, *path]:
                self._file("models", f"{user}/{name}", revision, "/".join(path))
            case _:
                self._answer(404)

    do_HEAD = do_GET  # noqa: N815

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        if self.headers.get("Authorization") != f"Bearer {TOKEN}":
            self._answer(401, {"error": "Invalid credentials in Authorization header"})
            return
        match self._path():
            case ["api", "repos", "create"]:
                self._create(json.loads(body))
            case ["api", "validate-yaml"]:
                self._answer(200, {"errors": [], "warnings": []})
            case ["api", "datasets" | "models", user, name, "preupload", _]:
                paths = [file["path"] for file in json.loads(body)["files"]]
                modes = [{"path": path, "uploadMode": "regular", "shouldIgnore": False} for path in paths]
                self._answer(200, {"files": modes})
            case ["api", "datasets" | "models", user, name, "commit", branch]:
                self._commit(f"{user}/{name}", branch, [json.loads(line) for line in body.splitlines()])
            case ["api", "datasets" | "models", user, name, "branch", branch]:
                repository = self.server.repositories[f"{user}/{name}"]
                repository.branches.setdefault(branch, repository.branches["main"])
                self._answer(200, {})
            case ["api", "datasets" | "models", user, name, "tag", revision]:
                repository = self.server.repositories[f"{user}/{name}"]
                commit = repository.resolve(revision)
                assert commit is not None
                repository.tags[json.loads(body)["tag"]] = commit
                self._answer(200, {})
            case _:
                self._answer(404)

    def do_DELETE(self) -> None:
        match self._path():
            case ["api", "datasets" | "models", user, name, "tag", tag] if (
                tag in self.server.repositories[f"{user}/{name}"].tags
            ):
                del self.server.repositories[f"{user}/{name}"].tags[tag]
                self._answer(200, {})
            case _:
                self._answer(404, code="RevisionNotFound")

    def _create(self, wanted: dict) -> None:
        repo_id = f"{wanted['organization'] or USER}/{wanted['name']}"
        if wanted["organization"] not in (None, USER):
            self._answer(403, {"error": "You don't have the rights to create a dataset under this namespace"})
            return
        is_new = repo_id not in self.server.repositories
        kind = f"{wanted.get('type') or 'model'}s"
        self.server.repositories.setdefault(repo_id, Repository(kind))
        folder = "" if kind == "models" else f"/{kind}"
        self._answer(200 if is_new else 409, {"url": f"{self.server.address}{folder}/{repo_id}"})

    def _commit(self, repo_id: str, branch: str, operations: list[dict]) -> None:
        repository = self.server.repositories[repo_id]
        files = dict(repository.files(branch))
        for operation in operations:
            value = operation["value"]
            if operation["key"] == "file":
                files[value["path"]] = base64.b64decode(value["content"])
            elif operation["key"] == "deletedFile":
                del files[value["path"]]
        name = repository.commit(branch, files)
        url = f"{self.server.address}/datasets/{repo_id}/commit/{name}"
        self._answer(200, {"commitUrl": url, "commitOid": name})

    def _describe(self, kind: str, repo_id: str, question: list[str]) -> None:
        repository = self.server.repositories.get(repo_id)
        if repository is None or repository.kind != kind:
            self._answer(404, code="RepoNotFound")
            return
        if question == ["refs"]:
            kinds = {"branches": ("heads", repository.branches), "tags": ("tags", repository.tags)}
            answer: dict = {"converts": []}
            for kind, (folder, refs) in kinds.items():
                answer[kind] = [
                    {"name": name, "ref": f"refs/{folder}/{name}", "targetCommit": commit}
                    for name, commit in refs.items()
                ]
            self._answer(200, answer)
            return
        revision = question[1] if len(question) > 1 else "main"
        commit = repository.resolve(revision)
        if commit is None:
            self._answer(404, code="RevisionNotFound")
            return
        files = repository.commits[commit]
        if question[:1] == ["tree"]:
            below = "/".join(question[2:])
            entries = [
                {"type": "file", "path": path, "size": len(content), "oid": _blob_name(content)}
                for path, content in files.items()
                if path.startswith(below)
            ]
            self._answer(200, entries)
        else:
            siblings = [{"rfilename": path} for path in files]
            self._answer(200, {"id": repo_id, "sha": commit, "siblings": siblings, "private": False})

    def _file(self, kind: str, repo_id: str, revision: str, path: str) -> None:
        repository = self.server.repositories.get(repo_id)
        commit = repository.resolve(revision) if repository and repository.kind == kind else None
        content = repository.commits[commit].get(path) if repository and commit else None
        if content is None:
            self._answer(404, code="EntryNotFound")
            return
        headers = {"ETag": f'"{_blob_name(content)}"', "X-Repo-Commit": str(commit)}
        self._send(200, content, headers | {"Content-Type": "application/octet-stream"})

    def _path(self) -> list[str]:
        return [unquote(part) for part in urlsplit(self.path).path.strip("/").split("/")]

    def _answer(self, status: int, content: object = None, code: str = "") -> None:
        body = json.dumps({} if content is None else content).encode()
        self._send(
            status, body, {"Content-Type": "application/json"} | ({"X-Error-Code": code} if code else {})
        )

    def _send(self, status: int, body: bytes, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


def _blob_name(content: bytes) -> str:
    return hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()
