"""CLIP in miniature, made here, so that nothing is downloaded: a tokenizer that spells, and the sizes of its text tower."""

from pathlib import Path

from transformers import CLIPTextConfig, CLIPTokenizer

START, END = "<|startoftext|>", "<|endoftext|>"
LETTERS = "abcdefghijklmnopqrstuvwxyz"
SYMBOLS = ["!", *LETTERS, *(f"{letter}</w>" for letter in (*LETTERS, ":")), "th", "the</w>", START, END]


def save_tokenizer(folder: Path) -> None:
    """It knows letters and the word "the"."""
    merges = [("t", "h"), ("th", "e</w>")]
    vocabulary = {symbol: index for index, symbol in enumerate(SYMBOLS)}
    CLIPTokenizer(vocab=vocabulary, merges=merges).save_pretrained(folder)


def text_config(dim: int, context: int) -> CLIPTextConfig:
    """Of a text tower for that tokenizer."""
    return CLIPTextConfig(
        vocab_size=len(SYMBOLS),
        hidden_size=dim,
        intermediate_size=2 * dim,
        num_hidden_layers=2,
        num_attention_heads=2,
        max_position_embeddings=context,
        bos_token_id=SYMBOLS.index(START),
        eos_token_id=SYMBOLS.index(END),
    )
